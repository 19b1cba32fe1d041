"""A response's arguments by position: those of its signature, and those of 0.1.0."""

import numpy as np
import pytest

import freqid as fq

F, G, V, HOLD = [1.0, 2.0], [1j, 0.5], [0.1, 0.2], fq.ZeroOrderHold(1e-3)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ((V, 1e-3, HOLD), {}),
        ((V, 1e-3), {"hold": HOLD}),
        ((V,), {"dt": 1e-3, "hold": HOLD}),
        ((), {"variance": V, "dt": 1e-3, "hold": HOLD}),
        ((1e-3, HOLD, V), {}),
        ((1e-3, HOLD), {"variance": V}),
        ((1e-3,), {"variance": V, "hold": HOLD}),
        ((1e-3, HOLD, V, [1.0, 0.5]), {}),
        ((V, 1e-3, HOLD, [1.0, 0.5]), {}),
    ],
)
def test_variance_sample_time_and_hold_are_told_by_what_they_are(given, named):
    frf = fq.FrequencyResponse(F, G, *given, **named)
    assert frf.variance.ravel().tolist() == V
    assert (frf.dt, frf.hold) == (1e-3, HOLD)
    assert (frf.coherence is not None) == (len(given) > 3)


@pytest.mark.parametrize(
    ("given", "named", "what"),
    [
        ((1e-3,), {"dt": 1.0}, "dt"),
        ((V,), {"variance": V}, "variance"),
        ((1e-3, HOLD, V), {"hold": HOLD}, "hold"),
    ],
)
def test_an_argument_that_is_given_twice_is_refused(given, named, what):
    with pytest.raises(TypeError, match=f"multiple values for.*'{what}'"):
        fq.FrequencyResponse(F, G, *given, **named)


def test_an_array_for_a_sample_time_is_named():
    with pytest.raises(ValueError, match="dt="):
        fq.FrequencyResponse(F, G, dt=V)


def test_a_hold_by_its_name_is_one_at_dt():
    """Found: the name was kept as it was, and a fit read it as band-limited: d = 218 for 10."""
    plant, f = fq.two_mass(), np.linspace(10, 80, 100)
    G = plant.frequency_response(2 * np.pi * f, hold=fq.ZeroOrderHold(5e-3)).response
    for seen in (
        fq.FrequencyResponse(f, G, dt=5e-3, hold="zoh"),
        fq.FrequencyResponse(f, G, None, 5e-3, "zoh"),
        fq.FrequencyResponse(f, G, 5e-3, "zoh"),
    ):
        assert seen.hold == fq.ZeroOrderHold(5e-3)
        assert fq.fit(plant, seen)["d"] == pytest.approx(10, rel=1e-6)
    assert fq.FrequencyResponse(f, G, hold="bl").hold == fq.BandLimited()
    for wrong in ({"hold": "zoh"}, {"hold": "xyz", "dt": 0.1}, {"hold": 5}):
        with pytest.raises(ValueError, match="hold="):
            fq.FrequencyResponse(f, G, **wrong)


@pytest.mark.parametrize(
    ("frequency", "words"),
    [
        ([-1, 2, 30], r"in Hz; frequency\[0\]=-1"), ([1, 3, 2], r"in Hz; frequency\[2\]=2"),
        ([1, np.nan, 2], r"in Hz; frequency\[1\]=nan"), ([], "in Hz; it has shape"),
    ],
)  # fmt: skip
def test_frequencies_that_are_none_are_named(frequency, words):
    with pytest.raises(ValueError, match=words):
        fq.FrequencyResponse(frequency, np.ones(len(frequency)))
    with pytest.raises(
        ValueError, match=words.replace("frequency", "omega").replace("Hz", "rad/s")
    ):
        fq.first_order().frequency_response(frequency)


def test_a_text_is_no_band():
    """Its two characters had been taken for 1 and 8 Hz."""
    record = fq.Record(fq.white_noise(500), fq.white_noise(500, seed=1), 0.01)
    with pytest.raises(ValueError, match=r"band='18' must be two frequencies"):
        fq.etfe(record, band="18")
