"""Plants that answer at once, and do so late: a fast lag takes the feedthrough's place."""

import re

import numpy as np
import pytest

import freqid as fq


def cell(R0, R1, t1, R2, t2, g):
    """A battery's voltage by its current: two lags, what drives it at rest, and its resistance."""
    A = [[-1 / t1, 0, 0], [0, -1 / t2, 0], [0, 0, 0]]
    return A, [[R1 / t1], [R2 / t2], [g]], [[1, 1, 1]], [[R0]]


TRUE = {"R0": 0.01, "R1": 0.006, "t1": 8.0, "R2": 0.012, "t2": 120.0, "g": 1.1e-4}
FREE = [fq.Parameter(n, v) for n, v in TRUE.items()]
INPUTS = {
    "white": lambda rng: rng.standard_normal(500),
    "steps": lambda rng: np.repeat(rng.standard_normal(25), 20),
}


@pytest.mark.study
@pytest.mark.parametrize("name", INPUTS)
@pytest.mark.parametrize(("delay", "seed"), [(1.0, 0), (0.5, 1), (0.5, 2), (0.2, 3)])
def test_a_current_that_comes_late(name, delay, seed):
    """Of 48 such records none had said so: "asymmetric", "another mode", R0 of 1e-5."""
    rng = np.random.default_rng(seed)
    u = 2 * INPUTS[name](rng)
    late = fq.simulate(fq.GreyBox(cell, FREE, input_delay=delay), u, 1.0)
    record = late.with_noise(0.01 * late.y.std(), seed=seed + 10)
    est = fq.fit(fq.GreyBox(cell, FREE), record)
    assert re.match("delay: the input acts .*later than the model says", est.verdict.reasons[0])
    # what is advised explains the data
    advised = fq.GreyBox(cell, [*FREE, fq.Parameter("Td", 0.5)], input_delay="Td")
    assert fq.fit(advised, record).cost < 0.8 * est.cost


@pytest.mark.parametrize("name", INPUTS)
def test_one_that_does_not_is_not_told_so(name):
    rng = np.random.default_rng(4)
    record = fq.simulate(fq.GreyBox(cell, FREE), 2 * INPUTS[name](rng), 1.0)
    est = fq.fit(fq.GreyBox(cell, FREE), record.with_noise(0.01 * record.y.std(), seed=5))
    assert est.witness.verdict == "complete"
    assert not any(w.kind == "delay" for w in est.warnings)


@pytest.mark.parametrize("seed", range(3))
def test_a_fast_lag_of_such_a_plant_is_no_delay(seed):
    """It explains more than a delay does, and has a size."""

    def behind(k, a, T):
        return [[-a, k], [0, -1 / T]], [[0], [1 / T]], [[1, 1]], None

    def plant(k, a):
        return [[-a]], [[k]], [[1]], [[1]]

    free = [fq.Parameter("k", 30.0), fq.Parameter("a", 60.0)]
    lagged = fq.GreyBox(behind, [*free, fq.Parameter("T", 3e-4)])
    u = np.repeat(np.random.default_rng(seed).standard_normal(50), 20)
    record = fq.simulate(lagged, u, 1e-3)
    est = fq.fit(fq.GreyBox(plant, free), record.with_noise(0.02 * record.y.std(), seed=seed + 70))
    assert re.match("lag: a lag of 0.000(29|30|31)", est.verdict.reasons[0])
