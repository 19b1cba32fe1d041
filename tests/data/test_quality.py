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


def _axis(K, tau):
    return [[0, 1], [0, -1 / tau]], [[0], [K / tau]], [[1, 0]], [[0]]


AXIS = fq.GreyBox(_axis, [fq.Parameter("K", 143.0, lower=0), fq.Parameter("tau", 0.2, lower=0)])
STEPS = np.repeat(np.random.default_rng(1).uniform(-11, 13, 200), 20)
ANGLE = fq.simulate(AXIS, STEPS, 2e-3).y


@pytest.mark.parametrize(
    "begin_again",
    [lambda y: y % 360, lambda y: (y + 180) % 360 - 180, lambda y: (y / 30 + 350) % 360,
     lambda y: np.floor(y * 4096 / 360) % 4096, lambda y: np.radians(y) % (2 * np.pi)],
    ids=["0 to 360", "-180 to 180", "seldom", "counts", "radians"],
)  # fmt: skip
def test_an_angle_that_begins_again_is_named(begin_again):
    """Found: no finding, and of a fit "no signal" or "not identifiable" alone."""
    y = begin_again(ANGLE)
    assert ("y", "wrapped") in _found(STEPS, y)
    est = fq.fit(AXIS, fq.Record(STEPS, y, 2e-3), n_starts=1)
    assert est.warnings[0].kind == "wrapped"
    assert est.verdict.grade == "do not use"
    turn = est.warnings[0].number
    undone = fq.fit(AXIS, fq.Record(STEPS, np.unwrap(y, period=turn), 2e-3), n_starts=1)
    assert undone["tau"] == pytest.approx(0.2, rel=0.02)


@pytest.mark.parametrize("code", [-9999.0, -999.0, 9.91e37])
@pytest.mark.parametrize("rows", [[500], [100, 101, 777]])
def test_a_code_for_no_value_is_named(code, rows):
    record = fq.simulate(fq.first_order(), fq.white_noise(2000, seed=1), 1e-3).with_noise(0.1)
    y = record.y.copy()
    y[rows] = code
    record = fq.Record(record.u, y, 1e-3)
    assert ("y", "code") in set(
        fq.check_record(record)[["channel", "finding"]].itertuples(index=False)
    )
    est = fq.fit(fq.first_order(), record)
    assert (est.warnings[0].kind, est.warnings[0].number) == ("code", code)
    assert est.verdict.grade == "do not use"


@pytest.mark.parametrize(
    "x",
    [
        180.0 * np.sign(np.sin(np.arange(2000) / 30)),
        np.random.default_rng(0).uniform(0, 360, 2000), 180 * np.sin(np.arange(2000) / 3),
        np.repeat([0.0, 255.0], 500), np.arange(999) % 99.0,
    ],
    ids=["square wave", "noise", "fast sine", "step", "nines amid others"],
)  # fmt: skip
def test_commands_and_what_is_rough_are_not_misread(x):
    kinds = {finding for _, finding in _found(x, np.cumsum(x))}
    assert not kinds & {"wrapped", "code"}


LAG = np.exp(-np.arange(1000) / 3)


@pytest.mark.parametrize(
    "y",
    [
        np.repeat([0.0, 355.0], 500), np.repeat([0.0, 255.0, 3.0], 300), 355 * (1 - LAG),
        360 * (1 - 0.01 * LAG) * (np.arange(1000) > 3),
        np.repeat([0.0, 359.0], 500) + 0.2 * np.abs(np.sin(np.arange(1000.0) ** 2)),
    ],
    ids=["step", "counts", "fast lag", "faster lag", "noisy step"],
)  # fmt: skip
def test_a_step_through_a_whole_range_is_no_turn(y):
    assert ("y", "wrapped") not in _found(np.arange(len(y)) * 1.0, y)


@pytest.mark.parametrize("size", [99.0, 999.0, -9999.0])
def test_a_pulse_from_rest_is_no_code(size):
    u = np.zeros(1000)
    u[100:150] = size
    assert ("u", "code") not in _found(u)


@pytest.mark.parametrize(
    ("step", "which", "found"), [(0.0, "y", True), (0.0, "u", False), (1e-3, "y", False)]
)
def test_a_sensor_that_stands_still_for_a_while(step, which, found):
    """A twentieth of the record was none; an encoder that rests, and a command, may stand still."""
    rng = np.random.default_rng(5)
    x = np.cumsum(rng.standard_normal(6000))
    x[3000:3300] = x[3000]
    x = np.round(x / step) * step if step else x
    other = rng.standard_normal(6000)
    record = fq.Record(x, other, 1e-3) if which == "u" else fq.Record(other, x, 1e-3)
    told = fq.check_record(record)
    assert ("stuck" in set(told["finding"])) == found
