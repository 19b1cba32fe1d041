"""A plant that is another from the middle of a record on, and what it looks like."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.fitting.suspects.changing import unsteady
from freqid.fitting.suspects.scene import Scene

DT = 2e-3
AXIS = fq.two_mass()


def changed(model, u, dt, factor=1, **part):
    """Output of a plant whose parameters change by these parts midway; its state goes on."""
    other = model.with_values(**{n: (1 + d) * model[n] for n, d in part.items()})
    middle = factor * (len(u) // factor // 2)
    x, y = None, []
    for plant, piece in ((model, u[:middle]), (other, u[middle:])):
        system = scipy.signal.cont2discrete(plant.state_space(), dt)
        _, answer, states = scipy.signal.dlsim((*system[:4], 1), piece, x0=x)
        x = system[0] @ states[-1] + system[1][:, 0] * piece[-1]
        y.append(answer[:, 0])
    return np.concatenate(y)[::factor]


@pytest.mark.parametrize("factor", [1, 4])
def test_columns_are_the_derivatives_of_a_plant_that_changes(factor):
    """Against differences of a simulation, which keeps its state: an axis rings for long."""
    N = 1200
    u = fq.white_noise(N, seed=3)
    record = fq.Record(u, changed(AXIS, u, DT), DT)
    if factor > 1:
        record = record.decimate(factor, keep_input=True)
    record = record.with_noise(1e-6 * record.y.std(), seed=1)
    est = fq.fit(AXIS, record)
    scene = Scene.of(est.minimum, est.inquiry.readings)
    columns = unsteady(scene, est.model).columns[0]
    seen = scene.seen[0]
    for name, column in zip(est.names, columns, strict=True):
        h = 1e-5
        up, down = (changed(AXIS, u, DT, factor, **{name: d}) for d in (h, -h))
        wanted = seen.sampled(((up - down) / (2 * h))[None, None])[0]
        np.testing.assert_allclose(column, wanted, atol=2e-3 * np.abs(wanted).max())


def test_a_lightly_damped_axis_that_changes_by_a_part_in_a_thousand_is_found():
    """As strong as a test that knows it needs for 99 %: 13 of 30 were found by its halves."""
    N = 1500
    u = np.resize(fq.multisine((1 / 1.5, 150), 1.5, DT, crest="random", seed=778), N)
    clean, moved = fq.simulate(AXIS, u, DT).y, changed(AXIS, u, DT, k=0.0016)
    said = []
    for seed in range(10):
        noise = clean.std() / 10 * np.random.default_rng(seed).standard_normal(N)
        est = fq.fit(AXIS, fq.Record(u, moved + noise, DT))
        said.append([w.kind for w in est.warnings])
    assert sum("unsteady" in kinds for kinds in said) >= 9, said


def test_a_mode_that_a_sweep_has_passed_and_that_moves_is_found():
    """Its ringing alone tells: one step from the first half's frequency does not reach it."""

    def mode(w, z, g):
        return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g * w * w, 0]], [[0]]

    values = {"w": 40.0, "z": 0.05, "g": 1.0}
    plant = fq.GreyBox(mode, [fq.Parameter(n, v) for n, v in values.items()])
    u = fq.chirp(1, 30, 6, 0.01)
    clean, moved = fq.simulate(plant, u, 0.01).y, changed(plant, u, 0.01, w=0.11)
    said = []
    for seed in range(8):
        noise = clean.std() / 10 * np.random.default_rng(seed).standard_normal(len(u))
        est = fq.fit(plant, fq.Record(u, moved + noise, 0.01))
        said.append([w.kind for w in est.warnings])
    assert sum("unsteady" in kinds for kinds in said) >= 7, said


@pytest.mark.study
def test_a_drift_that_made_friction_negative_is_named_before_it():
    """With a friction below zero the axis follows the drift; kept physical it cannot.

    A constant in the output with next to no friction imitates it: either may be the first.
    """
    u = fq.chirp(5, 150, 1.2, DT)
    clean = fq.simulate(AXIS, u, DT).y
    drift = 0.5 * clean.std() * np.linspace(-0.5, 0.5, len(u))
    for seed in range(6):
        e = np.random.default_rng(seed).standard_normal(len(u) + 300)
        noise = scipy.signal.lfilter([np.sqrt(1 - 0.81)], [1, -0.9], e)[300:]
        record = fq.Record(u, clean + drift + clean.std() / 20 * noise, DT)
        est = fq.fit(AXIS, record)
        said = [w.kind for w in est.warnings]
        assert est["fm"] < 0
        assert "drift" in said[:2], said
        assert said[-1] == "not physical", said


def test_a_half_without_input_shows_no_change():
    """After a blow a parameter would have to be another by a factor of hundreds to be seen."""
    plant = fq.GreyBox(
        lambda T, g: ([[-1 / T]], [[g / T]], [[1]], [[0]]),
        [fq.Parameter("T", 0.2, "s"), fq.Parameter("g", 1.0)],
    )
    u = np.zeros(400)
    u[5:10] = 1.0
    for seed in range(8):
        noise = scipy.signal.lfilter([1], [1, -0.9], np.random.default_rng(seed).normal(size=400))
        y = np.ravel(fq.simulate(plant, u, 0.01).y)
        record = fq.Record(u, y + 0.05 * y.std() * noise / noise.std(), 0.01)
        assert "unsteady" not in [w.kind for w in fq.fit(plant, record).warnings]
