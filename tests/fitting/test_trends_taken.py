"""Records whose means or trends were taken off, not at rest: right numbers, trusted."""

import tracemalloc

import numpy as np
import pandas as pd
import pytest
from scipy import signal

import freqid as fq
from freqid.fitting.cost.trends import trends_taken
from tests.fitting.test_smooth_inputs import axis, lag, spring

DT, SHARE = 0.01, 0.03
PLANTS = {"spring": spring, "lag": lag, "axis": axis}


def moving(plant, n, seed, slope=0.0, input_of="white"):
    """The second half of a simulation by scipy: it begins in full motion, its sensor is off."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(2 * n)
    if input_of == "steps":
        u = np.repeat(rng.standard_normal(2 * n // 20 + 1), 20)[: 2 * n]
    at = plant.state_space()
    y = signal.lsim((at.A, at.B, at.C, at.D), u, DT * np.arange(2 * n), interp=False)[1][n:]
    size = np.std(y)
    y = y + SHARE * size * rng.standard_normal(n) + 2 * size + slope * size * np.linspace(-1, 1, n)
    return fq.Record(u[n:], y, DT)


@pytest.mark.study
@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("input_of", ["white", "steps"])
def test_what_is_left_of_a_trend_is_no_fault(name, order, input_of):
    model, trusted, errors = PLANTS[name](), 0, []
    true = np.array(list(model.values.values()))
    for seed in range(8):
        record = moving(model, 400, seed, slope=float(order), input_of=input_of).detrend(order)
        est = fq.fit(model, record)
        trusted += est.verdict.trusted
        errors.append((est.values - true) / np.sqrt(np.diag(est.covariance_matrix)))
    assert trusted >= 7
    assert np.sqrt(np.mean(np.square(errors))) < 1.6
    assert np.abs(errors).max() < 5


def test_trends_that_others_took_off_are_seen():
    record = moving(lag(), 300, 1, slope=1.0)
    y, u = record.outputs[:, 0], record.inputs[:, 0]
    assert trends_taken(record) == 0
    assert trends_taken(fq.Record(u - u.mean(), y - y.mean(), DT)) == 1
    assert trends_taken(fq.Record(signal.detrend(u), signal.detrend(y), DT)) == 2
    # of one channel alone nothing is known
    assert trends_taken(fq.Record(u, y - y.mean(), DT)) == 0


def test_noise_free_a_detrended_record_gives_the_plant():
    # what was taken off is a polynomial in the output, whatever the plant makes of it
    record = moving(spring(), 500, 2, slope=1.0)
    noise_free = fq.simulate(spring(), record.inputs[:, 0], DT, initial_state=[0.3, -1.0])
    for order in (0, 1, 2):
        est = fq.fit(spring(), noise_free.detrend(order), start={"m": 0.6, "d": 1.5, "k": 90.0})
        assert np.allclose(est.values, [0.5, 2.0, 80.0], rtol=1e-8)


def test_a_fleet_of_detrended_records_is_as_their_fits():
    records = [moving(lag(), 400, seed, slope=1.0).detrend(1) for seed in range(12)]
    table = fq.fit_many(lag(), records, progress=False)
    assert isinstance(table, pd.DataFrame)
    for (_, row), record in zip(table.iterrows(), records, strict=True):
        est = fq.fit(lag(), record)
        assert np.allclose([row["K"], row["tau"]], est.values, rtol=1e-5)


@pytest.mark.parametrize("more", [0, 1])
def test_weights_may_be_of_all_lines(more):
    """With the line at zero, which tells nothing here, or without it."""
    record = moving(lag(), 300, 4).detrend()
    weights = np.linspace(1.0, 2.0, 150 + more)
    est = fq.fit(lag(), record, weights=weights)
    assert np.allclose(est.values, [3.0, 0.1], rtol=0.05)
    with pytest.raises(ValueError, match=r"expected \(150,\)"):
        fq.fit(lag(), record, weights=np.ones(149))


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("name", PLANTS)
def test_the_same_in_time(order, name):
    """A slope off the torque of an axis had moved J threefold, trusted."""
    model = PLANTS[name]()
    true = np.array(list(model.values.values()))
    record = moving(model, 600, 0, slope=1.0, input_of="steps").detrend(order)
    if order == 0:
        record = moving(model, 600, 0, input_of="steps").detrend(0)
    est = fq.fit(model, record, domain="time")
    assert np.all(np.abs(est.values - true) < 4 * np.sqrt(np.diag(est.covariance_matrix)))
    assert est.verdict.grade != "do not use"


def test_looking_for_trends_takes_no_memory():
    """It had held four more arrays as long as a record."""
    record = fq.Record(*np.random.default_rng(0).standard_normal((2, 1_000_000)), 1e-3)
    tracemalloc.start()
    try:
        assert trends_taken(record) == 0
        assert tracemalloc.get_traced_memory()[1] < 1e5
    finally:
        tracemalloc.stop()


def test_an_offset_is_found_beside_a_line_that_was_taken_off():
    record = moving(lag(), 400, 3, slope=1.0).detrend(1)
    est = fq.fit(lag(), record, offset="estimate")
    assert est.verdict.trusted
    assert np.allclose(est.values, fq.fit(lag(), record).values, rtol=1e-3)


@pytest.mark.parametrize(
    ("order", "words"),
    [(None, None), (0, "no channel holds a constant"), (1, "no channel holds a straight line")],
)
def test_an_estimate_says_what_was_taken_off(order, words):
    """A free constant in the cost was said nowhere."""
    record = moving(lag(), 400, 0)
    est = fq.fit(lag(), record if order is None else record.detrend(order))
    told = [note for note in est.notes if "that was taken off" in note]
    assert len(told) == (words is not None)
    assert words is None or words in told[0]
