"""Plants behind a delay, which the tools of the bias left out: Td = 0, 100 % fit, trust."""

import numpy as np
import pytest

import freqid as fq

DT = 1e-3


def plant(delay=4e-3):
    parameters = [
        fq.Parameter("b", 100.0),
        fq.Parameter("a", 100.0),
        fq.Parameter("Td", delay, "s"),
    ]
    return fq.GreyBox(lambda b, a: ([[-a]], [[b]], [[1.0]], None), parameters, input_delay="Td")


@pytest.mark.parametrize("delay", [4e-3, 4.3e-3])
def test_what_data_show_is_the_held_response_behind_the_delay(delay):
    """Against the pulse response in closed form: the input reaches the lag within a sample."""
    seen = fq.apparent_response(plant(delay), fq.WhiteSpectrum(), DT, fq.ZeroOrderHold(DT))
    pole, late = np.exp(-0.1), delay / DT % 1
    # the step's part after the delay's fraction, and what is left of the sample before
    first = 1 - np.exp(-0.1 * (1 - late))
    second = np.exp(-0.1 * (1 - late)) - pole
    z = np.exp(1j * seen.omega * DT)
    exact = (first + second / z) / (1 - pole / z) * z ** -(delay // DT + 1)
    np.testing.assert_allclose(seen.response[0, 0], exact, atol=1e-12)


@pytest.mark.study
@pytest.mark.parametrize("spectrum", [fq.WhiteSpectrum(), fq.ChirpSpectrum(1, 100)])
@pytest.mark.parametrize("delay", [4e-3, 4.3e-3])
def test_the_true_hold_leaves_no_bias(spectrum, delay):
    est = fq.asymptotic_fit(plant(delay), spectrum, DT, "zoh", start={"Td": 2e-3, "a": 70.0})
    assert est.values == pytest.approx([100, 100, delay], rel=1e-6)
    assert est.verdict.grade == "trust"


def test_a_slow_hold_moves_the_delay_as_it_does_in_long_records():
    expected = fq.asymptotic_fit(
        plant(), fq.ChirpSpectrum(1, 100), 4 * DT, "zoh", fq.ZeroOrderHold(DT)
    )
    record = fq.simulate(plant(), fq.chirp(1, 100, 100, DT), DT)
    found = fq.fit(plant(), record.decimate(4), hold="zoh", band=(1, 100))
    assert found.values == pytest.approx(expected.values, rel=0.01)
    assert expected["Td"] < 3e-3


@pytest.mark.study
def test_maps_and_designs_know_it():
    table = fq.bias_map(
        plant(), {"1-100": fq.ChirpSpectrum(1, 100)}, [1, 4], ["zoh", None], DT, progress=False
    )
    bias = table.set_index(["factor", "hold", "parameter"])["relative_bias"]
    assert bias.abs().groupby(["factor", "hold"]).max()[4, "remembered"] < 1e-6
    assert bias[4, "zoh", "Td"] == pytest.approx(-0.34, abs=0.01)
    ranked = fq.experiment_design(plant(), DT, noise_std=0.01, factors=[1, 2])
    assert (ranked.loc[ranked["factor"] == 1, "bias Td"].abs() < 1e-6).all()
    black = fq.asymptotic_fit(
        plant(), fq.WhiteSpectrum(), DT, "zoh", model=fq.TransferFunction(0, 1, delay="estimate")
    )
    assert black["delay"] == pytest.approx(4e-3, rel=1e-6)


def test_what_is_explained_to_rounding_is_settled_behind_a_delay_as_well():
    record = fq.simulate(plant(), fq.white_noise(600, seed=1), DT)
    est = fq.fit(plant(), record, start={"Td": 3.2e-3, "a": 80.0})
    assert est.witness.verdict == "complete"
    assert est.verdict.grade == "trust"


def test_a_delay_that_a_black_box_has_found_is_the_plants():
    """A ContinuousModel knows its delay as well, which went the same way."""
    record = fq.simulate(plant(), fq.white_noise(600, seed=1), DT)
    found = fq.fit(fq.TransferFunction(0, 1, delay="estimate"), record).model
    seen = fq.apparent_response(found, fq.WhiteSpectrum(), DT)
    exact = fq.apparent_response(plant(), fq.WhiteSpectrum(), DT)
    np.testing.assert_allclose(seen.response, exact.response, atol=1e-9)


def test_integrators_and_known_delays():
    """b/(s (s + a)), 4 ms late by a number, and band-limited by a parameter."""
    parameters = [fq.Parameter("b", 100.0), fq.Parameter("a", 100.0)]
    integrating = fq.GreyBox(
        lambda b, a: ([[0, 1], [0, -a]], [[0], [b]], [[1.0, 0]], None), parameters, input_delay=4e-3
    )
    est = fq.asymptotic_fit(
        integrating, fq.ChirpSpectrum(1, 100), DT, "zoh", start={"a": 70.0, "b": 140.0}
    )
    assert est.values == pytest.approx([100, 100], rel=1e-6)
    between = fq.BandLimited()
    seen = fq.apparent_response(plant(), fq.WhiteSpectrum(), DT, between, base_dt=DT)
    s = 1j * seen.omega
    np.testing.assert_allclose(seen.response[0, 0], 100 / (s + 100) * np.exp(-4e-3 * s), atol=1e-12)


def test_a_delay_that_ends_at_nothing_is_at_its_bound():
    """Two late inputs under a slow hold: without noise no error bar gives what is left a scale."""
    parameters = [
        fq.Parameter(n, v)
        for n, v in (("b1", 50.0), ("b2", 30.0), ("a", 20.0), ("T1", 3.7e-3), ("T2", 1.2e-3))
    ]
    two = fq.GreyBox(
        lambda b1, b2, a: ([[-a]], [[b1, b2]], [[1.0]], None), parameters, input_delay=["T1", "T2"]
    )
    est = fq.asymptotic_fit(two, fq.ChirpSpectrum(1, 40), 5 * DT, "zoh", fq.ZeroOrderHold(DT))
    assert est["T2"] == pytest.approx(0, abs=1e-9)
    assert "edge of a bound" in [w.kind for w in est.warnings]


def test_a_delay_of_nothing_is_no_bound_that_the_data_push_against():
    est = fq.asymptotic_fit(plant(0.0), fq.ChirpSpectrum(1, 100), DT, "zoh", start={"a": 80.0})
    assert est["Td"] == pytest.approx(0, abs=1e-9)
    assert not est.warnings


def test_a_hold_that_no_delay_goes_with_is_refused_before_work_begins():
    """All of its rows were infinite, without a reason."""
    with pytest.raises(ValueError, match=r"holds has 'foh': the plant's input_delay needs"):
        fq.experiment_design(plant(0.0037), DT, noise_std=0.1, holds=[None, "foh"])
