"""What check_record says of channels that rest, and of those that are overloaded."""

import numpy as np
import pytest

import freqid as fq


def _found(u, y=None):
    y = np.sin(np.arange(len(u)) / 50) + 1e-3 * np.cos(np.arange(len(u))) if y is None else y
    table = fq.check_record(fq.Record(u, y, 1e-3))
    return set(zip(table["channel"], table["finding"], strict=True))


@pytest.mark.parametrize("lengths", [(200, 200), (20, 400)], ids=["even", "uneven"])
@pytest.mark.parametrize("seed", range(5))
def test_steps_between_levels_are_no_overload(lengths, seed):
    rng = np.random.default_rng(seed)
    stand = rng.integers(lengths[0], lengths[1] + 1, 20)
    found = _found(np.repeat(rng.uniform(-1, 1, 20), stand))
    assert not found & {("u", "saturated"), ("u", "stuck")}


@pytest.mark.parametrize("rest", [0, 800], ids=["moving", "with pauses"])
@pytest.mark.parametrize("grid", [0.0, 1e-2], ids=["fine", "quantised"])
def test_what_is_clipped_is_an_overload(rest, grid):
    t = np.arange(3000) * 1e-3
    wave = np.clip(np.sin(90 * t) + 0.4 * np.sin(171 * t), -0.8, 0.8)
    u = np.concatenate([np.zeros(rest), wave, np.zeros(rest), wave])
    u = grid * np.round(u / grid) if grid else u
    assert ("u", "saturated") in _found(u)
