"""Minima with unphysical values, where one with physical ones explains the data as well."""

import numpy as np
import pytest
import scipy

import freqid as fq

HEATER, DT, N = {"K": 8.0, "T1": 300.0, "T2": 60.0, "Td": 23.0}, 10.0, 720


def heater(K, T1, T2):
    return [[-1 / T1, 0], [1 / T2, -1 / T2]], [[K / T1], [0]], [[0, 1.0]], None


def stepped(start, seed):
    """A model and two hours of a heater, its power stepped after five minutes, 1 % of noise; the
    dead time breaks each period in two exponentials.
    """
    A, B = (np.array(M, float) for M in heater(8.0, 300.0, 60.0)[:2])
    whole, part = divmod(HEATER["Td"], DT)

    def step(duration):
        M = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 3))]]) * duration)
        return M[:2, :2], M[:2, 2]

    u, x, y = 1.0 * (np.arange(N) >= 30), np.zeros(2), np.empty(N)
    for i in range(N):
        y[i] = x[1]
        for duration, k in ((part, i - int(whole) - 1), (DT - part, i - int(whole))):
            F, g = step(duration)
            x = F @ x + g * (u[k] if k >= 0 else 0.0)
    y += 0.01 * y.std() * np.random.default_rng(seed).standard_normal(N)
    parameters = [fq.Parameter(n, v) for n, v in zip(HEATER, start, strict=True)]
    return fq.GreyBox(heater, parameters, input_delay="Td"), fq.Record(u, y, DT)


# starts that lead to a lag that grows, and to a delay of 50 samples with a lag without an end
STARTS = [(5.86, 759.4, 91.0, 10.0), (3.14, 657.8, 27.3, 40.0), (4.32, 566.7, 115.0, 10.0)]


@pytest.mark.study
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("seed", range(4))
def test_a_heater_has_lags_that_end(start, seed):
    """A lag of -18,000 ± 10,000 s behind a delay of 510 s: 51 outputs that this leaves open had
    taken up as much noise.
    """
    est = fq.fit(*stepped(start, seed))
    low, high = sorted((est["T1"], est["T2"]))
    assert low == pytest.approx(60, rel=0.1)
    assert high == pytest.approx(300, rel=0.02)
    assert est["Td"] == pytest.approx(23, abs=3)


def test_what_the_data_want_for_certain_stays_unphysical():
    """The paper's damping of -231 under the slow hold is no chance."""
    plant = fq.two_mass()
    fast = fq.simulate(plant, fq.chirp(10, 80, 20, 0.5e-3), 0.5e-3)
    est = fq.fit(plant, fast.decimate(10), hold="zoh", band=(10, 80))
    assert est["d"] < -200
