"""Black boxes of several channels leave no more than the true plant, which leaves the noise."""

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import freqid as fq

DT = 0.01


def sampled(poles, inputs, outputs, rng):
    """Modes and lags with these poles (rad/s), random inputs and outputs, sampled by scipy."""
    blocks = []
    for p in poles:
        a, b = np.real(p), np.imag(p)
        blocks.append([[a, b], [-b, a]] if b else [[a]])
    A = scipy.linalg.block_diag(*blocks)
    weight = np.concatenate([np.full(len(b), np.sqrt(abs(b[0][0]))) for b in blocks])
    B = weight[:, None] * rng.standard_normal((len(A), inputs))
    C = rng.standard_normal((outputs, len(A)))
    D = np.zeros((outputs, inputs))
    return scipy.signal.cont2discrete((A, B, C, D), DT)[:4], len(A)


def record_of(poles, inputs, outputs, seed, n, every, colour, noise=0.2):
    """A record from rest, inputs held ``every`` samples, and the noise in it."""
    rng = np.random.default_rng(seed)
    plant, order = sampled(poles, inputs, outputs, rng)
    u = np.repeat(rng.standard_normal((n // every + 1, inputs)), every, axis=0)[:n]
    y = scipy.signal.dlsim((*plant, DT), u)[1]
    e = scipy.signal.lfilter([1], [1, -colour], rng.standard_normal((n + 300, outputs)), axis=0)
    e = noise * y.std(axis=0) * e[300:] / e.std(axis=0)
    return fq.Record(u, y + e, DT), e, order


def left(est, record):
    """Sum of squares that a fit leaves in time."""
    y, fit = record.outputs, np.atleast_1d(fq.compare(est, record).fit_percent)
    return float((((1 - fit / 100) ** 2) * ((y - y.mean(axis=0)) ** 2).sum(axis=0)).sum())


LIGHT = [-0.66 + 37.8j, -0.12 + 22.4j, -0.14 + 25.7j, -26.9]
LAGS = [-1.35 + 93j, -0.6 + 76.9j, -0.8 + 70j, -0.73, -27.8]


@pytest.mark.study
@pytest.mark.parametrize("seed", [2, 5, 0, 1, 3, 4])
@pytest.mark.parametrize(
    ("poles", "shape", "data"),
    [
        # a mode that is excited little had been lost to noise, of such a plant in 10 of 12 records
        pytest.param(LIGHT, (2, 1), (500, 40, 0.0), id="light"),
        # a descent had ended where the coordinates of its chart bent, in 5 of 12
        pytest.param(LAGS, (2, 1), (1500, 4, 0.9), id="lags"),
        # the only mode had gone to slow noise, in 10 of 10
        pytest.param([-0.32 + 25.5j], (3, 3), (4000, 40, 0.9), id="one"),
        # a real pole stood for slow noise
        pytest.param([-3 + 14.8j, -25.4], (3, 2), (1500, 40, 0.9), id="wide"),
    ],
)
def test_no_fit_leaves_more_than_the_noise(poles, shape, data, seed):
    record, e, order = record_of(poles, *shape, seed, *data)
    est = fq.fit(fq.OutputError(order), record)
    assert left(est, record) <= (e**2).sum()


@pytest.mark.study
@pytest.mark.parametrize("seed", [2, 0, 1, 3, 4])
def test_costs_fall_from_order_to_order(seed):
    """Of five records of another such plant orders 4 to 8 had been chosen, never the true one, and
    costs rose from one to the next.
    """
    record, _, order = record_of(LIGHT, 2, 1, seed, 500, 40, 0.0)
    table = fq.select_order(record, range(1, 9))
    assert (np.diff(table["cost"]) <= 1e-9 * table["cost"].max()).all()
    # the lag is worth about as much as it costs in this noise
    assert table.attrs["best"] in (order - 1, order)
