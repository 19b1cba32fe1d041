"""Sensors of few digits: where their steps are as good as noise, and where an output rests."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.suspects.coarse import _series, _step

LAG = fq.first_order(b=50, a=20)
MODE = fq.GreyBox(
    lambda w, z, g: ([[0, 1], [-(w**2), -2 * z * w]], [[0], [g * w**2]], [[1, 0]], None),
    [fq.Parameter("w", 70.0, lower=0), fq.Parameter("z", 0.03, lower=0), fq.Parameter("g", 1.2)],
)


def seen(plant, kind, step, noise, seed):
    """A record whose sensor has steps, and noise, of these parts of the output's deviation."""
    rng = np.random.default_rng(seed)
    u = {
        "step": np.where(np.arange(2000) > 200, 1.0, 0.0),
        "white": rng.standard_normal(2000),
        "chirp": fq.chirp(0.5, 60, 4, 2e-3),
    }[kind]
    y = fq.simulate(plant, u, 2e-3).y
    q = step * y.std()
    y = y + noise * y.std() * rng.standard_normal(len(y))
    return fq.Record(u, np.round(y / q) * q, 2e-3)


@pytest.mark.study
@pytest.mark.parametrize(
    ("plant", "step", "noise"), [(LAG, 0.2, 0.02), (MODE, 0.1, 0.02), (MODE, 0.2, 0.02)]
)
def test_a_plateau_between_two_steps_is_not_trusted(plant, step, noise):
    """Of intervals none held, and 7 to 16 of 20 were trusted."""
    said = 0
    for seed in range(8):
        est = fq.fit(plant, seen(plant, "step", step, noise, seed))
        assert est.verdict.grade != "trust"
        assert any(abs(est[n] - plant[n]) > 2 * est.parameters["std"][n] for n in plant.values)
        said += any(w.kind == "coarse" for w in est.warnings)
    # where what is left shows something, that is said first
    assert said >= (1 if plant is LAG else 2)


@pytest.mark.study
@pytest.mark.parametrize(
    ("kind", "step", "noise"),
    [("white", 0.2, 0.02), ("chirp", 0.1, 0.02), ("white", 0.05, 0.01), ("step", 0.05, 0.05)],
)
@pytest.mark.parametrize("plant", [LAG, MODE])
def test_steps_that_are_as_good_as_noise_are_no_fault(plant, kind, step, noise):
    held = []
    for seed in range(12):
        est = fq.fit(plant, seen(plant, kind, step, noise, seed))
        assert not any(w.kind == "coarse" for w in est.warnings)
        table = est.parameters
        held += [table["lower"][n] <= plant[n] <= table["upper"][n] for n in plant.values]
    assert np.mean(held) > 0.8


def test_the_error_of_rounding_is_the_series_of_it():
    """Mean error of a rounded value in noise, against an integral of its density."""
    q, sigma = 1.0, 0.25
    for x in (0.1, 0.25, 0.4):
        sizes = _series(q, sigma**2)
        k = np.arange(1, len(sizes) + 1)
        series = np.sum((-1.0) ** k * sizes * np.sin(2 * np.pi * k * x / q))
        codes = np.arange(-5, 6)
        inside = np.diff(scipy.stats.norm.cdf(np.arange(-5.5, 6), x, sigma))
        assert series == pytest.approx(float(codes @ inside) - x, abs=1e-6)


def test_the_step_of_a_sensor():
    rng = np.random.default_rng(0)
    assert _step(np.round(rng.standard_normal(300) / 0.02) * 0.02) == pytest.approx(0.02)
    assert _step(rng.standard_normal(300)) == 0
    assert _step(np.ones(300)) == 0
