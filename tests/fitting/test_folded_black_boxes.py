"""Black boxes of slow outputs beside fast inputs, against plants in their own set.

Started as if each line had one frequency of the input they ended in mirror images, at thousands of
times the noise, and some were trusted.
"""

import numpy as np
import pytest
from scipy import signal

import freqid as fq

DT, N = 5e-3, 3000


def record(num, den, u, factor, noise, seed):
    """Sampled exactly by scipy; and the cost that the noise leaves."""
    plant = signal.cont2discrete(signal.tf2ss(num, den), DT)
    y = signal.dlsim((*plant[:4], DT), u)[1][:, 0]
    size = noise * y.std()
    y = y + size * np.random.default_rng(seed).standard_normal(len(u))
    slow = fq.Record(u, y, DT).decimate(factor, keep_input=True)
    return slow, size**2 * len(slow.y)


PLANTS = {
    "lag": ([3.0], [1, 3.0]),
    "two lags": ([30.0], [1, 13, 30.0]),
    "resonance": ([100.0], [1, 2, 100.0]),
    "order 3, zero on the right": ([-2.0, 40], np.polymul([1, 5], [1, 2, 100.0])),
    # above the Nyquist frequency of the output at factor 5
    "fast resonance": ([3e4], [1, 6, 3e4]),
}


@pytest.mark.study
@pytest.mark.parametrize("factor", [2, 5, 10])
@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("stable", [False, True])
def test_white_inputs(plant, factor, stable):
    num, den = PLANTS[plant]
    for seed in range(3):
        u = np.random.default_rng(seed).standard_normal(N)
        data, left = record(num, den, u, factor, 0.01, seed + 9)
        est = fq.fit(fq.OutputError(len(den) - 1, stable=stable), data)
        assert est.cost < 1.2 * left, (seed, est.cost / left)
        true = np.sort_complex(np.exp(np.roots(den) * DT))
        poles = np.sort_complex(np.linalg.eigvals(est.model.state_space().A))
        assert np.abs(poles - true).max() < 0.02


@pytest.mark.study
def test_random_plants():
    """Order 1 to 5, modes up to eight tenths of the fast Nyquist frequency, factors 2 to 8: 23 of
    24 are found (99 of 100); the other, with a mode at twice the output's rate, is a doubt.
    """
    missed = []
    for case in range(24):
        rng = np.random.default_rng(case)
        order, factor = int(rng.integers(1, 6)), int(rng.integers(2, 9))
        modes, den, num = order // 2, np.ones(1), np.zeros(1)
        if order % 2:
            den = np.array([1, rng.uniform(5, 60)])
            num = den[1:] * rng.uniform(0.3, 1)
        for w in np.sort(10 ** rng.uniform(0.7, np.log10(0.8 * np.pi / DT), modes)):
            pair = np.array([1, 2 * rng.uniform(0.02, 0.2) * w, w**2])
            gain = w**2 * rng.choice([-1, 1]) * rng.uniform(0.2, 1)
            num = np.polyadd(np.polymul(num, pair), gain * den)
            den = np.polymul(den, pair)
        num = np.trim_zeros(num, "f")
        data, left = record(num, den, rng.standard_normal(N), factor, 0.02, case)
        est = fq.fit(fq.OutputError(order), data)
        if est.cost > 1.3 * left:
            missed.append((case, order, factor, round(est.cost / left, 2), est.verdict.grade))
    assert [case for case, *_ in missed] == [8] or not missed, missed
    assert all(grade != "trust" for *_, grade in missed)


def test_several_channels():
    """Two inputs and two outputs of order 4 at a fourth of the rate."""
    rng = np.random.default_rng(3)
    A = np.zeros((4, 4))
    for i, (w, z) in enumerate([(8.0, 0.05), (31.0, 0.04)]):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, w], [-w, -2 * z * w]]
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((2, 4))
    Ad, Bd, Cd, Dd, _ = signal.cont2discrete((A, B, C, np.zeros((2, 2))), DT)
    u = rng.standard_normal((N, 2))
    y = signal.dlsim((Ad, Bd, Cd, Dd, DT), u)[1]
    size = 0.01 * y.std(axis=0)
    noisy = fq.Record(u, y + size * rng.standard_normal(y.shape), DT)
    data = noisy.decimate(4, keep_input=True)
    est = fq.fit(fq.OutputError(4), data)
    assert est.cost < 1.2 * (size**2).sum() * len(data.y)


@pytest.mark.study
def test_the_order_is_chosen():
    num, den = PLANTS["resonance"]
    data, _ = record(num, den, np.random.default_rng(0).standard_normal(N), 5, 0.01, 1)
    assert fq.select_order(data, range(1, 6)).attrs["best"] == 2


@pytest.mark.study
@pytest.mark.parametrize("factor", [2, 5])
def test_several_records(factor):
    num, den = PLANTS["order 3, zero on the right"]
    made = [
        record(num, den, np.random.default_rng(seed).standard_normal(N), factor, 0.01, seed + 5)
        for seed in range(3)
    ]
    est = fq.fit(fq.OutputError(3), [data for data, _ in made])
    assert est.cost < 1.2 * sum(left for _, left in made)
    assert est.verdict.grade == "trust"


@pytest.mark.study
@pytest.mark.parametrize("factor", [2, 5, 12])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_integrators(factor, noise, capfd):
    """A start whose pole a line meets had no response: three of eight were lost without noise."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(200 * factor)
        y = np.concatenate([[0], np.cumsum(u)[:-1]]) * DT
        size = noise * y.std()
        slow = fq.Record(u, y + size * rng.standard_normal(len(u)), DT).decimate(
            factor, keep_input=True
        )
        est = fq.fit(fq.OutputError(1), slow)
        assert est.cost < 1.3 * size**2 * 200 + 1e-9 * (slow.y**2).sum()
    assert "DLASCL" not in "".join(capfd.readouterr())


@pytest.mark.study
@pytest.mark.parametrize(("factor", "slow"), [(20, 60), (25, 60), (25, 100)])
def test_few_lines_for_many_inputs(factor, slow):
    """The lifted plant of 20 and 25 inputs cannot be told from 30 lines: 1 to 3 of 12 were lost."""
    for rate in (5.0, 20.0, 60.0):
        for seed in range(4):
            u = np.random.default_rng(seed).standard_normal(factor * slow)
            data, left = record([rate], [1, rate], u, factor, 0.01, seed + 3)
            est = fq.fit(fq.OutputError(1), data)
            assert est.cost < 2 * left, (rate, seed, est.cost / left)


@pytest.mark.parametrize("slow_first", [True, False])
def test_a_record_beside_a_slow_one_may_come_first(slow_first):
    """An IndexError in the verdict: the period was read off an experiment without aliases."""
    plant = fq.GreyBox(
        lambda k, c: ([[0, 1], [-k, -c]], [[0], [1]], [[1.0, 0]], None),
        [fq.Parameter("k", 400.0), fq.Parameter("c", 4.0)],
    )
    made = fq.simulate(plant, fq.white_noise(900, seed=3), 5e-3)
    made = made.with_noise(0.05 * float(np.std(made.y)), seed=4)
    both = [made, made.decimate(3, keep_input=True)]
    est = fq.fit(plant, both[::-1] if slow_first else both)
    assert est.verdict.grade == "trust"
    assert est.witness.verdict == "complete"
