"""Periods averaged before the plant had come to its periodic answer, told by its modes."""

import numpy as np
import pytest
import scipy

import freqid as fq

DT = 0.02
TRUE = {"k1": 400.0, "k2": 900.0, "c": 0.6, "J": 1.5}


def matrices(k1, k2, c, J):
    """Two masses, the first of them tied to the ground; a force on each, both places measured."""
    A = [
        [0, 0, 1, 0], [0, 0, 0, 1],
        [-(k1 + k2) / J, k2 / J, -c / J, c / J], [k2, -k2, c, -1.5 * c],
    ]  # fmt: skip
    return A, [[0, 0], [0, 0], [1 / J, 0], [0, 1]], [[1, 0, 0, 0], [0, 1, 0, 0]], None


def plant(seed):
    rng = np.random.default_rng(seed)
    return fq.GreyBox(
        matrices,
        [fq.Parameter(k, v * np.exp(rng.uniform(-0.2, 0.2))) for k, v in TRUE.items()],
    )


def answers(u):
    """From rest, held over each sample: one step of the matrix exponential after another."""
    A, B, C, _ = (np.array(M, float) if M is not None else None for M in matrices(**TRUE))
    whole = scipy.linalg.expm(np.block([[A, B], [np.zeros((2, 6))]]) * DT)
    x, y = np.zeros(4), np.empty((len(u), 2))
    for k, each in enumerate(u):
        y[k] = C @ x
        x = whole[:4, :4] @ x + whole[:4, 4:] @ each
    return y


def periods(seed, n, P, before, noise, colour=0.0, on_inputs=0.0):
    """Two experiments of multisines of random phase that began so many periods before."""
    rng = np.random.default_rng(seed)
    runs = []
    for _ in range(2):
        X = np.zeros((n // 2 + 1, 2), complex)
        X[1 : n // 2] = np.exp(2j * np.pi * rng.random((n // 2 - 1, 2)))
        one = np.fft.irfft(X, n, axis=0)
        u = np.tile(one / one.std(), (P + before, 1))
        y = answers(u)[before * n :]
        u = u[before * n :]
        e = scipy.signal.lfilter([1], [1, -colour], rng.standard_normal(y.shape), axis=0)
        y = y + noise * y.std(axis=0) * e / e.std(axis=0)
        runs.append(fq.Record(u + on_inputs * rng.standard_normal(u.shape), y, DT))
    return fq.periodic(runs, period=n * DT)


def transient(est):
    return [w for w in est.warnings if w.kind == "transient"]


@pytest.mark.study
@pytest.mark.parametrize(("n", "P"), [(128, 2), (256, 3), (128, 4), (256, 2)])
def test_dampings_of_what_still_moved_are_doubted(n, P):
    """All were trusted, with no warning, the damping 5 to 20 % and up to 15 standard errors off:
    six periods are one to two time constants of the slower mode.
    """
    far = 0
    for seed in range(6):
        est = fq.fit(plant(seed), periods(seed, n, P, 6, 0.1))
        c = est.parameters.loc["c"]
        off = abs(c["value"] - TRUE["c"]) / c["std"]
        if off > 4:
            far += 1
            assert not est.verdict.trusted
            assert "c by" in str(transient(est)[0])
    assert far >= 3


@pytest.mark.study
@pytest.mark.parametrize(
    ("colour", "on_inputs", "noise"),
    [(0.0, 0.0, 0.1), (0.9, 0.0, 0.01), (0.9, 0.02, 0.01), (0.0, 0.02, 0.001)],
    ids=["white", "coloured", "coloured, noisy inputs", "noisy inputs"],
)
def test_what_has_settled_is_not_doubted(colour, on_inputs, noise):
    """Noise of a sensor of the input looks like the plant, and that of others runs past the ends of
    a period as a motion does.
    """
    for seed in range(12):
        n, P = [(128, 2), (256, 3), (128, 8)][seed % 3]
        frf = periods(100 + seed, n, P, 6000 // n, noise, colour, on_inputs)
        assert not transient(fq.fit(plant(seed), frf))


@pytest.mark.study
@pytest.mark.parametrize("order", [4, 2])
def test_sampled_black_boxes_of_periods_are_asked_as_others_are(order):
    """Their suspects were not asked at all: "unexplained" was what could be said."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        n, P = 256, 3
        one = fq.multisine((0.2, 24), n * DT, DT, crest="random", seed=seed)
        for before in (40, 6):
            u = np.column_stack([np.tile(one, P + before), np.zeros(n * (P + before))])
            y = answers(u)[before * n :, 0]
            y = y + 0.02 * y.std() * rng.standard_normal(len(y))
            frf = fq.periodic(fq.Record(u[before * n :, 0], y, DT), period=n * DT)
            kinds = [w.kind for w in fq.fit(fq.OutputError(order), frf).warnings]
            assert ("transient" in kinds) == (before == 6), kinds
            assert ("another mode" in kinds) == (order == 2 and before == 40), kinds


def test_change_is_that_of_the_first_period():
    frf = periods(0, 128, 3, 6, 0.1)
    assert frf.change.shape == (4, 2, 63)
    assert frf.period == pytest.approx(128 * DT)
    # the input is the same in each
    assert np.abs(frf.change[2:]).max() < 1e-12 * np.abs(frf.inputs).max()
    part = frf.select((1.0, 5.0))
    at = np.isin(frf.frequency, part.frequency)
    np.testing.assert_array_equal(part.change, frf.change[..., at])


def test_streams_are_asked_as_records_are():
    """A stream takes its periods some at a time; the first of them is kept."""
    rng = np.random.default_rng(1)
    n, P = 256, 5
    one = fq.multisine((0.2, 24), n * DT, DT, crest="random", seed=1)
    u = np.column_stack([np.tile(one, P), np.zeros(n * P)])
    y = answers(u)[:, 0]
    record = fq.Record(u[:, 0], y + 0.01 * y.std() * rng.standard_normal(len(y)), DT)
    both = np.column_stack([u[:, 0], record.y])
    stream = fq.open(lambda: (both[i : i + 500] for i in range(0, len(y), 500)), dt=DT)
    inside, beside = fq.periodic(record, period=n * DT), fq.periodic(stream, period=n * DT)
    np.testing.assert_allclose(beside.change, inside.change, rtol=1e-9, atol=1e-15)
    assert beside.settled == pytest.approx(inside.settled, rel=1e-6)
