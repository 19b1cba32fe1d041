"""Inputs that the logger has written a sample or two late: outputs that answer before they are
asked, which looks like another hold or like a plant that answers at once.
"""

import numpy as np
import pytest

import freqid as fq
from tests.fitting.test_jumps import AXIS, DT, VALUES, axis, measured

LAG = fq.GreyBox(
    lambda T, g: ([[-1 / T]], [[g / T]], [[1.0]], None),
    [fq.Parameter("T", 0.2), fq.Parameter("g", 1.0)],
)


def logged_late(plant, kind, rows, seed):
    """A record simulated in scipy whose input stands so many rows late."""
    u, y = measured(plant, kind, seed)
    return fq.Record(np.concatenate([np.zeros(rows), u[:-rows]]), y, DT)


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", ["noise", "chirp"])
@pytest.mark.parametrize(("plant", "rows"), [(LAG, 1), (AXIS, 1), (AXIS, 2), (LAG, 2)])
def test_an_input_that_is_logged_late_is_named_with_its_rows(plant, rows, kind, seed):
    """It was "hold rejected" (straight lines between the samples), which cures half of it."""
    late = logged_late(plant, kind, rows, seed)
    est = fq.fit(plant, late)
    assert est.verdict.grade != "trust"
    assert est.warnings[0].kind == "delay"
    assert f"logged {rows} sample" in est.warnings[0]
    # the cure that it names
    cured = fq.fit(plant, fq.Record(late.u[rows:], late.y[:-rows], DT))
    assert cured.verdict.trusted
    for name, std in cured.parameters["std"].items():
        assert abs(cured[name] - plant.parameter(name).value) < 4.5 * std


def test_the_other_cure_is_a_delay_that_may_be_negative():
    late = logged_late(AXIS, "chirp", 1, 1)
    free = fq.Parameter("Td", 0.0, lower=-5 * DT, upper=5 * DT, physical=(-np.inf, np.inf))

    def with_delay(Jm, Ja, k, d, f, Td):
        return axis(Jm, Ja, k, d, f)

    est = fq.fit(fq.GreyBox(with_delay, [*AXIS.parameters, free], input_delay="Td"), late)
    assert est.verdict.trusted
    for name, truth in {**VALUES, "Td": -DT}.items():
        assert abs(est[name] - truth) < 4.5 * est.parameters["std"][name]


@pytest.mark.study
@pytest.mark.parametrize("plant", [AXIS, LAG], ids=["axis", "lag"])
def test_straight_lines_between_the_samples_are_still_a_hold(plant):
    """Half a sample of lead is what a first-order hold has, no row."""
    u = np.random.default_rng(4).standard_normal(2000)
    record = fq.simulate(plant, u, DT, hold="foh").with_noise(0.002, seed=4)
    est = fq.fit(plant, fq.Record(record.u, record.y, DT), hold="zoh")
    assert est.warnings[0].kind == "hold rejected"


@pytest.mark.study
@pytest.mark.parametrize("rows", [2, 1])
def test_of_two_inputs_the_one_that_is_logged_late_is_named(rows):
    two = fq.GreyBox(
        lambda T, g, h: ([[-1 / T]], [[g / T, h / T]], [[1.0]], None),
        [fq.Parameter("T", 0.2), fq.Parameter("g", 1.0), fq.Parameter("h", 2.0)],
        inputs=["valve", "heater"],
    )
    u = np.random.default_rng(5).standard_normal((2000, 2))
    record = fq.simulate(two, u, DT).with_noise(0.005, seed=5)
    late = u.copy()
    late[rows:, 0], late[:rows, 0] = u[:-rows, 0], 0
    est = fq.fit(two, fq.Record(late, record.y, DT, input_names=["valve", "heater"]))
    assert est.warnings[0].kind == "delay", est.warnings
    assert "input 'valve' acts" in est.warnings[0]
    assert f"logged {rows} sample" in est.warnings[0]
