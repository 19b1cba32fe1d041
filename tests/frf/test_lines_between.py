"""Multisines of few lines: what local fractions say between the lines that these drive."""

import numpy as np
import pytest

import freqid as fq

N, DT = 2000, 5e-4
MODES = fq.GreyBox(
    lambda g1, f1, z1, g2, f2, z2: (
        [
            [0, 1, 0, 0],
            [-((2 * np.pi * f1) ** 2), -4 * np.pi * f1 * z1, 0, 0],
            [0, 0, 0, 1],
            [0, 0, -((2 * np.pi * f2) ** 2), -4 * np.pi * f2 * z2],
        ],
        [[0], [g1 * (2 * np.pi * f1) ** 2], [0], [g2 * (2 * np.pi * f2) ** 2]],
        [[1, 0, 1, 0]],
        None,
    ),
    [
        fq.Parameter("g1", 1.0), fq.Parameter("f1", 300.0), fq.Parameter("z1", 0.01),
        fq.Parameter("g2", -0.6), fq.Parameter("f2", 318.0), fq.Parameter("z2", 0.012),
    ],
)  # fmt: skip
LINES = np.unique(np.round(np.geomspace(100, 600, 40)).astype(int))


def few_lines(seed):
    """Two close modes under one period of forty lines, from rest, with 2 % of white noise."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(LINES))
    u = np.cos(2 * np.pi * np.outer(np.arange(N), LINES) / N + phase).sum(axis=1)
    record = fq.simulate(MODES, u, DT)
    return record.with_noise(0.02 * record.y.std(), seed=seed)


@pytest.mark.parametrize("band", [None, (100.0, 600.0)])
def test_lines_around_which_none_are_driven_are_left_out(band):
    """Up to ten lines had been 1e12 standard errors off, and a fit to them wrong in 4 of 4."""
    for seed in range(3):
        frf = fq.local_rational(few_lines(seed), band=band)
        line = np.round(frf.frequency * N * DT).astype(int)
        assert np.isin(LINES, line).all()
        true = MODES.frequency_response(frf.omega, fq.ZeroOrderHold(DT)).response
        assert (np.abs(frf.response - true) ** 2 / frf.variance).max() < 25
        est = fq.fit(MODES, frf, weights="noise")
        assert est.verdict.grade == "trust"
        assert np.abs(est.values / list(MODES.values.values()) - 1).max() < 0.02


def test_a_band_that_is_not_driven_at_all_is_refused():
    """Responses of 1e12 had come of it."""
    with pytest.raises(ValueError, match="drives no line of the band"):
        fq.local_rational(few_lines(0), band=(700, 900))


def test_lines_between_many_that_are_driven_are_kept():
    """Every second line, a binary sequence's zeros and noise leave out nothing."""
    rng = np.random.default_rng(1)
    odd = fq.multisine((2, 400), 2.0, DT, 1, "random", seed=1, grid="odd")
    inputs = [
        rng.standard_normal(N),
        np.repeat(rng.choice([-1.0, 1.0], N // 4), 4),
        fq.chirp(5, 400, N * DT, DT),
        odd,
    ]
    for u in inputs:
        record = fq.simulate(MODES, u, DT).with_noise(0.01, seed=2)
        frf = fq.local_rational(record, band=(10, 390))
        spacing = 1 / (record.n_samples * DT)
        assert np.allclose(np.diff(frf.frequency), spacing)


def test_few_lines_do_not_tell_two_inputs_apart():
    """Each line was the same one equation for two unknowns: up to 1e31 standard errors off."""
    plant = fq.GreyBox(
        lambda a, b, c: ([[-a, b], [-b, -a]], [[1, 0], [0, c]], [[1, 0], [0, 1]], None),
        [fq.Parameter("a", 20.0), fq.Parameter("b", 200.0), fq.Parameter("c", 2.0)],
    )
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, (4, len(LINES)))
    u = np.cos(2 * np.pi * np.arange(N)[:, None] / N * LINES + phases[:, None]).sum(axis=-1)
    records = [fq.simulate(plant, u[at].T, DT).with_noise(1e-3, seed=1) for at in ([0, 1], [2, 3])]
    with pytest.raises(ValueError, match="as many experiments as inputs"):
        fq.local_rational(records[0], band=(300, 600))
    for given in (records[0], records):
        frf = fq.local_rational(given)
        true = plant.frequency_response(frf.omega, fq.ZeroOrderHold(DT)).response
        assert (np.abs(frf.response - true) ** 2 / frf.variance).max() < 30
    rough = np.random.default_rng(1).standard_normal((N, 2))
    assert len(fq.local_rational(fq.simulate(plant, rough, DT)).frequency) == N // 2 - 1
