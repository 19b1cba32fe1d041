"""Inputs that come late, each by its own time: named, with that time, and not taken for a mode."""

import numpy as np
import pytest

import freqid as fq

DT, N = 0.01, 3000
K, C, B, D = 400.0, 2.0, 1.0, 0.6


def mass(k, c, b, d, T=0.0):
    A = np.array([[0, 1], [-k, -c]])
    return A, np.array([[0, 0], [b, d]]), np.array([[1.0, 0]]), np.zeros((1, 2))


def plant(late=None):
    """A mass on a spring, pushed by two inputs."""
    values = {"k": K, "c": C, "b": B, "d": D} | ({"T": 0.004} if "T" in (late or ()) else {})
    return fq.GreyBox(mass, [fq.Parameter(n, v) for n, v in values.items()], input_delay=late)


def excited(kind, seed):
    rng = np.random.default_rng(seed)
    if kind == "binary":
        return np.repeat(rng.choice([-1.0, 1.0], (N // 10, 2)), 10, axis=0)
    if kind == "white":
        return rng.standard_normal((N, 2))
    phases = [fq.multisine((0.1, 20), N * DT, DT, 1, "random", seed=2 * seed + i) for i in (0, 1)]
    return np.column_stack(phases)


def record(late, kind, level, seed=0):
    made = fq.simulate(plant(late), excited(kind, seed), DT)
    return made.with_noise(level * float(np.std(made.y)), seed=seed + 100)


def times(reason):
    """Input by input, by how much it acts later (ms)."""
    found = {}
    for part in reason.split("input ")[1:]:
        name, _, number, unit, way = part.split()[:5]
        found[name.strip("'")] = (
            float(number) * {"ms": 1, "s": 1e3}[unit] * {"later": 1}.get(way, -1)
        )
    return found


CASES = [
    ([0.0, 0.003], None, {"u2": 3}),
    ([0.0, 0.034], None, {"u2": 34}),
    # more than half a turn of the mode, which looks like the other sign
    ([0.0, 0.12], None, {"u2": 120}),
    ([0.03, 0.012], None, {"u1": 30, "u2": 12}),
    ([0.02, 0.034], [0.02, 0.02], {"u2": 14}),
    ([0.006, 0.02], [0.02, 0.02], {"u1": -14}),
]


@pytest.mark.parametrize(("late", "known", "told"), CASES)
def test_the_input_that_comes_late_is_named_with_its_time(late, known, told):
    named(late, known, told, "white")


def named(late, known, told, kind):
    est = fq.fit(plant(known), record(late, kind, 0.02))
    assert est.warnings[0].kind == "delay"
    assert times(est.verdict.reasons[0]) == pytest.approx(told, abs=0.15)
    assert est.verdict.grade != "trust"


@pytest.mark.study
@pytest.mark.parametrize("kind", ["binary", "multisine"])
@pytest.mark.parametrize(("late", "known", "told"), CASES)
def test_under_other_inputs_as_well(late, known, told, kind):
    named(late, known, told, kind)


def test_a_delay_of_all_inputs_is_said_of_all():
    est = fq.fit(plant(), record([0.013, 0.013], "white", 0.05))
    said = est.verdict.reasons[0]
    assert float(said.split("every input acts ")[1].split(" ms later")[0]) == pytest.approx(
        13, 0.05
    )


def test_beside_an_input_whose_delay_is_fitted_the_other_is_named():
    est = fq.fit(plant(["T", 0.0]), record([0.02, 0.05], "white", 0.02))
    assert est.warnings[0].kind == "delay"
    assert times(est.verdict.reasons[0])["u2"] == pytest.approx(50, abs=0.2)


@pytest.mark.study
@pytest.mark.parametrize("late", [[0.03, 0.012], [0.0, 0.034]])
def test_one_delay_of_a_black_box_is_not_enough_for_inputs_that_differ(late):
    est = fq.fit(fq.TransferFunction(1, 2, delay="estimate"), record(late, "white", 0.02))
    told = times(est.verdict.reasons[0])
    assert np.sign(told["u2"] - told["u1"]) == np.sign(late[1] - late[0])


@pytest.mark.study
@pytest.mark.parametrize("kind", ["white", "binary", "multisine"])
def test_delays_that_are_right_are_trusted(kind):
    est = fq.fit(plant([0.02, 0.006]), record([0.02, 0.006], kind, 0.1))
    assert est.verdict.grade == "trust"
    assert est.suspects["p_value"]["delay"] > 0.001
