"""Parameters that are held, or bounded, where the data do not want them."""

import numpy as np
import pytest

import freqid as fq

DT = 0.02


def lag(b=2.0, a=3.0):
    return [[-a]], [[b]], [[1.0]], [[0.0]]


def pendulum(m=0.8, length=0.5, c=0.05):
    J = m * length**2
    return [[0, 1], [-9.81 / length, -c / J]], [[0], [1 / J]], [[1.0, 0]], [[0.0]]


def lags(seed, excitation="white"):
    u = fq.white_noise(500, seed=seed) if excitation == "white" else fq.chirp(0.05, 8, 20, DT)
    record = fq.simulate(fq.first_order(b=9, a=5), u, DT)
    return record.with_noise(0.05 * record.y.std(), seed=seed)


HELD = fq.Parameter("a", 3.0, fixed=True)
BOUND = fq.Parameter("a", 3.0, upper=4.0)


@pytest.mark.parametrize("a", [HELD, BOUND], ids=["held", "bounded"])
@pytest.mark.parametrize("excitation", ["white", "chirp"])
def test_what_is_held_elsewhere_is_said_first(a, excitation):
    """It had been friction in 120 of 120, with "a better minimum was missed" beside it."""
    for seed in range(2):
        est = fq.fit(fq.GreyBox(lag, [fq.Parameter("b", 2.0), a]), lags(seed, excitation))
        found = est.warnings[0]
        assert found.kind == "held"
        assert found.number == pytest.approx(5, rel=0.05)
        assert est.verdict.grade == "doubt"
        assert not any("friction" in r for r in est.verdict.reasons)
        if a is HELD:
            assert len(est.verdict.reasons) == 1
        else:
            assert "edge of a bound" in [w.kind for w in est.warnings]


@pytest.mark.parametrize(("name", "value"), [("c", 0.1), ("length", 0.55)])
def test_a_pendulum_with_one_value_taken_as_known(name, value):
    plant = fq.GreyBox(
        pendulum, [fq.Parameter(n, v) for n, v in (("m", 0.8), ("length", 0.5), ("c", 0.05))]
    )
    record = fq.simulate(plant, fq.white_noise(1500, seed=3), DT)
    record = record.with_noise(0.05 * record.y.std(), seed=4)
    est = fq.fit(plant.with_values(**{name: value}).fix(name), record)
    assert est.warnings[0].kind == "held"
    assert est.warnings[0].number == pytest.approx(plant[name], rel=0.02)


def rubbed(seed, part=0.4):
    """A lag whose input loses a part of its own size to friction, sample by sample."""
    u = fq.white_noise(600, seed=seed)
    grow, gain = np.exp(-5 * DT), (1 - np.exp(-5 * DT))
    x, y = 0.0, np.zeros(600)
    for k in range(600):
        y[k] = x
        x = grow * x + gain * (u[k] - part * np.tanh(x / 0.02))
    return fq.Record(u, y, DT).with_noise(0.02 * y.std(), seed=seed + 9)


def test_friction_beside_what_is_held_rightly_is_friction():
    """A faster lag imitates it, and leaves of it what speaks as well."""
    plant = fq.GreyBox(lag, [fq.Parameter("b", 5.0), fq.Parameter("a", 5.0, fixed=True)])
    for seed in range(2):
        est = fq.fit(plant, rubbed(seed))
        assert not est.verdict.trusted
        assert "held" not in [w.kind for w in est.warnings]


def test_two_that_are_held_and_do_the_same_are_both_said():
    circuit = fq.GreyBox(
        lambda R, L, C: ([[0, 1 / C], [-1 / L, -R / L]], [[0], [1 / L]], [[1.0, 0]], [[0.0]]),
        [fq.Parameter("R", 2.0), fq.Parameter("L", 0.1), fq.Parameter("C", 0.02)],
    )
    record = fq.simulate(circuit, fq.white_noise(1500, seed=1), 0.01).with_noise(0.02, seed=2)
    est = fq.fit(circuit.with_values(C=0.025).fix("L", "C"), record)
    assert est.warnings[0].kind == "held"
    assert "hardly tell" in est.warnings[0]
    # cut errors are those of a wrong fit
    robust = fq.fit(circuit.with_values(C=0.025).fix("L", "C"), record, loss="huber")
    assert "held" not in [w.kind for w in robust.warnings]
    assert not robust.verdict.trusted


def test_what_is_held_rightly_is_not_said():
    """Right values, and another fault beside them: a delay, and saturation."""
    u = 3 * fq.white_noise(800, seed=5)
    plant = fq.GreyBox(lag, [fq.Parameter("b", 9.0), fq.Parameter("a", 5.0, fixed=True)])
    right = fq.simulate(fq.first_order(b=9, a=5), u, DT).with_noise(0.01, seed=6)
    assert fq.fit(plant, right).verdict.trusted
    late = fq.Record(right.u[2:], right.y[:-2], DT)
    limited = fq.Record(u, fq.simulate(fq.first_order(b=9, a=5), np.clip(u, -2, 2), DT).y, DT)
    for record in (late, limited):
        est = fq.fit(plant, record)
        assert not est.verdict.trusted
        assert "held" not in [w.kind for w in est.warnings]
