"""Multisines for robots: several inputs, orthogonal experiments, sparse grids, low peaks."""

import numpy as np
import pytest

import freqid as fq

N = 512


def spectra(u):
    return np.fft.rfft(u, axis=-2)[..., 1 : N // 2, :]


@pytest.mark.parametrize("n_inputs", [1, 2, 3, 6])
def test_orthogonal_experiments_tell_the_inputs_apart(n_inputs):
    u = fq.multisine(
        (2, 40), 1.0, 1 / N, n_inputs=n_inputs, orthogonal=True, crest="random", seed=3
    )
    assert u.shape == (n_inputs, N, n_inputs)
    U = spectra(u)[:, 1:40]
    gram = np.einsum("eki,ekj->kij", U.conj(), U)
    assert np.allclose(gram, gram[0, 0, 0].real * np.eye(n_inputs), atol=1e-6 * abs(gram[0, 0, 0]))
    assert np.allclose(u.std(axis=1), 1)


def test_independent_signals():
    u = fq.multisine((2, 60), 1.0, 1 / N, periods=2, n_inputs=3)
    assert u.shape == (2 * N, 3)
    assert np.abs(np.corrcoef(u.T) - np.eye(3)).max() < 0.5
    assert np.abs(u).max() < 1.6
    # one that is another delayed would be told from it by no line alone, but by few of them
    U = np.fft.rfft(u[:N], axis=0)[2:61]
    for other in (1, 2):
        turn = np.exp(1j * np.diff(np.angle(U[:, other] / U[:, 0])))
        assert abs(turn.mean()) < 0.5


@pytest.mark.parametrize(
    ("grid", "rule"),
    [("full", lambda k: k > 0), ("odd", lambda k: k % 2 == 1), ("odd-odd", lambda k: k % 4 == 1)],
)
def test_grids(grid, rule):
    u = fq.multisine((3, 90), 1.0, 1 / N, grid=grid, crest="schroeder")
    lines = np.flatnonzero(np.abs(np.fft.rfft(u)) > 1e-6)
    every = np.arange(3, 91)
    assert lines.tolist() == every[rule(every)].tolist()


def test_a_logarithmic_grid():
    u = fq.multisine((1, 200), 1.0, 1 / N, grid="log", crest="random")
    k = np.flatnonzero(np.abs(np.fft.rfft(u)) > 1e-6)
    assert (k % 2 == 1).all()
    # as dense as the odd lines allow at first, evenly in the logarithm above
    steps = np.diff(np.log(k))[len(k) // 2 :]
    assert steps.max() / steps.min() < 4


# the peaks that the best published search reaches within six seconds
@pytest.mark.study
@pytest.mark.parametrize(
    ("lines", "size", "peak"),
    [(30, 512, 1.402), (100, 1024, 1.386), (300, 2048, 1.36), (1000, 4096, 1.32)],
)
def test_peaks_are_low(lines, size, peak):
    u = fq.multisine((1, lines), 1.0, 1 / size)
    assert np.abs(u).max() < peak
    power = np.abs(np.fft.rfft(u)[1 : lines + 1])
    assert np.allclose(power, power[0])


def test_what_is_refused():
    with pytest.raises(ValueError, match="grid='even'"):
        fq.multisine((1, 30), 1.0, 1 / N, grid="even")
    with pytest.raises(ValueError, match="no line of grid='odd-odd'"):
        fq.multisine((2, 4), 1.0, 1 / N, grid="odd-odd")
    with pytest.raises(ValueError, match="makes one signal"):
        fq.multisine((2, 9), 1.0, 1 / N, n_inputs=2, crest="schroeder")
    with pytest.raises(ValueError, match="n_inputs"):
        fq.multisine((2, 9), 1.0, 1 / N, n_inputs=0)
