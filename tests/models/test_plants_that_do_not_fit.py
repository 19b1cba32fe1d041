"""Plants, holds, inputs and spectra that do not go together, each said by name."""

import functools

import control
import numpy as np
import pytest
import scipy.linalg

import freqid as fq
from freqid.lti.holds import InputHolds

LAG = fq.first_order()
OMEGA = np.linspace(1, 100, 9)


def two_lags(a, b):
    return np.diag([-a, -b]), np.eye(2), np.eye(2), None


TWO = fq.GreyBox(two_lags, [fq.Parameter("a", 3.0), fq.Parameter("b", 4.0)])


def test_a_hold_for_each_input_of_another_number():
    three = InputHolds((fq.ZeroOrderHold(0.1),) * 3)
    with pytest.raises(ValueError, match="hold has 3 entries for 2 inputs"):
        TWO.frequency_response(OMEGA, three)


def test_a_delay_of_no_parameter_and_of_a_tied_one():
    late = [fq.Parameter("a", 3.0), fq.Parameter("b", 4.0), fq.Parameter("Ta", 0.01)]
    with pytest.raises(ValueError, match="input_delay='Td'"):
        fq.GreyBox(two_lags, late, input_delay="Td")
    with pytest.raises(ValueError, match="input_delay='Ta' is tied; tie the other parameter to it"):
        fq.GreyBox(two_lags, late, ties={"Ta": "a / 300"}, input_delay="Ta")


@pytest.mark.parametrize("delays", [(0.0, 0.02), (0.01, 0.02)])
def test_each_input_has_its_own_delay_in_control(delays):
    late = fq.GreyBox(two_lags, TWO.parameters, input_delay=list(delays))
    at = late.to_control(pade=6)
    G = at(1j * OMEGA)
    wanted = np.array([
        [np.exp(-1j * OMEGA * delays[0]) / (1j * OMEGA + 3), 0 * OMEGA],
        [0 * OMEGA, np.exp(-1j * OMEGA * delays[1]) / (1j * OMEGA + 4)],
    ])  # fmt: skip
    np.testing.assert_allclose(G, wanted, atol=1e-5 * np.abs(wanted).max())


def test_a_delay_needs_a_hold_that_keeps_its_value():
    late = fq.GreyBox(two_lags, TWO.parameters, input_delay=0.013)
    with pytest.raises(ValueError, match="a delay needs a zero-order hold or a band-limited"):
        fq.simulate(late, np.ones((20, 2)), 0.01, hold="foh")


def test_a_band_limited_input_has_no_beginning():
    for start in (np.nan, np.inf):
        # before numpy computes with it, and warns
        with pytest.raises(ValueError, match=r"initial_state=.* finite"):
            fq.simulate(LAG, np.ones(20), 0.01, initial_state=[start])
    with pytest.raises(ValueError, match="initial_state has no meaning for a band-limited"):
        fq.simulate(LAG, np.ones(20), 0.01, hold="bl", initial_state=[1.0])


def test_mechanics_whose_output_is_said_twice():
    parameters = [fq.Parameter("k", 9.0)]
    with pytest.raises(ValueError, match=r"measured='velocity' beside C of shape \(1, 2\)"):
        fq.mechanical(
            [[1.0]], lambda k: [[k]], C=[[1.0, 0.5]], parameters=parameters, measured="velocity"
        )


def test_ties_of_no_parameter():
    with pytest.raises(ValueError, match="ties='c'"):
        fq.GreyBox(two_lags, TWO.parameters, ties={"c": "a"})


def test_a_jacobian_that_leaves_out_a_parameter():
    def slopes(a, b):
        return {"a": (np.diag([-1.0, 0]), None, None, None)}

    short = fq.GreyBox(two_lags, TWO.parameters, jacobian=slopes)
    record = fq.simulate(TWO, np.ones((20, 2)), 0.01)
    with pytest.raises(ValueError, match="jacobian returned no derivative by 'b'"):
        fq.fit(short, record)


def test_a_discrete_model_under_another_period_and_a_band_limited_input():
    record = fq.simulate(LAG, fq.white_noise(400, seed=3), 0.05).with_noise(0.01, seed=1)
    found = fq.fit(fq.OutputError(1, feedthrough=True), record).model
    with pytest.raises(ValueError, match=r"hold=.* must have the model's own period, 0\.05 s"):
        found.to_continuous(fq.ZeroOrderHold(0.04))
    # impulse invariance: its impulse response, times dt, is the model's, half of the jump at zero
    Phi, Gamma, C, D = found.matrices
    at = found.to_continuous("bl")
    for k in range(1, 9):
        own = (C @ np.linalg.matrix_power(Phi, k - 1) @ Gamma).item()
        made = 0.05 * (at.C @ scipy.linalg.expm(0.05 * k * at.A) @ at.B).item()
        assert made == pytest.approx(own, rel=1e-8, abs=1e-12)
    assert at.D.item() + 0.05 * (at.C @ at.B).item() / 2 == pytest.approx(D.item(), abs=1e-10)


def test_spectra_that_excite_nothing():
    with pytest.raises(ValueError, match="no energy"):
        fq.apparent_response(LAG, fq.ChirpSpectrum(2, 4), 0.1, base_dt=0.01, frequency=[4.6, 4.8])
    assert fq.ChirpSpectrum(2, 9).__add__(3) is NotImplemented
    with pytest.raises(TypeError):
        fq.ChirpSpectrum(2, 9) + 3


def test_plants_with_nothing_free():
    held = LAG.fix("a", "b")
    with pytest.raises(ValueError, match=r"no free parameter; free one with plant\.free"):
        fq.bias_map(held, {"x": fq.ChirpSpectrum(2, 9)}, [2], ["zoh"], 0.01)
    with pytest.raises(ValueError, match=r"no free parameter; free one with model\.free"):
        fq.asymptotic_fit(held, fq.ChirpSpectrum(2, 9), 0.05, base_dt=0.01)


def test_a_filter_of_two_channels():
    both = control.ss(np.diag([-1.0, -2]), np.eye(2), np.eye(2), np.zeros((2, 2)))
    shaped = fq.FilteredSpectrum(both)
    with pytest.raises(ValueError, match="system has 2 inputs and 2 outputs"):
        shaped.density(np.linspace(0, 1, 5), 0.1)


def test_what_a_matrix_names_with_a_default_is_passed():
    """A condition with a default was frozen there: 5 of 5 trusted, 64 % off at 86 error bars."""
    load = {"load": 0.0}
    values = [fq.Parameter("m", 2.0), fq.Parameter("k", 50.0), fq.Parameter("d", 1.0)]

    def mass(m, load=0.0, scale=1.0):
        return [[(m + load) * scale]]

    body = fq.mechanical(
        mass, lambda k=3.0: [[k]], lambda d: [[d]], parameters=values, conditions=load
    )
    assert np.abs(body.poles[0]) ** 2 == pytest.approx(50 / 2)
    assert np.abs(body.with_conditions(load=3.0).poles[0]) ** 2 == pytest.approx(50 / 5)
    assert np.abs(body.with_values(k=80.0).poles[0]) ** 2 == pytest.approx(80 / 2)
    # what is bound is no default
    stiff = functools.partial(lambda k: [[k]], k=900.0)
    held = fq.mechanical(mass, stiff, lambda d: [[d]], parameters=values, conditions=load)
    assert np.abs(held.poles[0]) ** 2 == pytest.approx(900 / 2)
    with pytest.raises(ValueError, match="wide"):
        fq.mechanical(lambda m, wide: [[m]], [[1.0]], parameters=values)
