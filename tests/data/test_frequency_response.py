"""A response's arguments by position: those of its signature, and those of 0.1.0."""

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
