"""Ctrl-C in a fit: the best point so far comes back, and says so."""

import signal
import threading
import time

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.suspects import turned

RECORD = fq.simulate(fq.first_order(), fq.chirp(2, 40, 4, 5e-3), 5e-3).with_noise(0.01)


@pytest.fixture(autouse=True)
def _heard():
    """Jobs that a shell has put into the background are deaf to Ctrl-C, and so are their tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def plant(after, slow=False, always=False):
    """A lag whose matrices are interrupted when they have been asked for so many times."""
    calls = []

    def matrices(b, a):
        calls.append(1)
        if len(calls) == after or (always and len(calls) > after):
            if slow:
                # as a function that never returns would be: what a process is sent may meet another
                # of its threads, which leaves this one asleep
                here = threading.get_ident()
                threading.Timer(0.2, signal.pthread_kill, (here, signal.SIGINT)).start()
                time.sleep(30)
            raise KeyboardInterrupt
        return [[-a]], [[b]], [[1.0]], [[0.0]]

    parameters = [fq.Parameter("b", 150.0), fq.Parameter("a", 60.0)]
    return fq.GreyBox(matrices, parameters), calls


def whole():
    model, calls = plant(10**9)
    est = fq.fit(model, RECORD)
    return est, len(calls)


def test_the_best_point_so_far_comes_back():
    full, count = whole()
    done = 0
    before = plant(10**9)
    begun = len(before[1])
    for after in range(begun + 8, count - 3, 2):
        model, _ = plant(after)
        est = fq.fit(model, RECORD)
        done += 1
        if est.message.startswith("interrupted"):
            assert not est.converged
            assert any("interrupted" in w for w in est.warnings)
            assert est.cost >= full.cost * (1 - 1e-9)
            assert np.isfinite(est.values).all()
            assert est.verdict.grade != "trust"
    assert done > 3


def test_nothing_is_fitted_again_once_it_was_interrupted(monkeypatch):
    """Other signs of the channels were: eight seconds after a Ctrl-C."""
    monkeypatch.setattr(turned, "fitter_of", lambda model: pytest.fail("fitted again"))
    _, calls = plant(10**9)
    stopped, _ = plant(len(calls) + 12)
    est = fq.fit(stopped, RECORD, start={"b": -10.0, "a": 1.0}, n_starts=1)
    assert est.message.startswith("interrupted")
    assert "interrupted" in est.verdict.reasons[0]


def test_a_function_that_does_not_return_ends_with_ctrl_c():
    _, count = whole()
    model, _ = plant(count - 4, slow=True)
    begin = time.perf_counter()
    est = fq.fit(model, RECORD)
    assert time.perf_counter() - begin < 10
    assert est.message.startswith("interrupted")


def test_nothing_known_is_nothing_given_back():
    _, calls = plant(10**9)
    again, _ = plant(len(calls) + 1, always=True)
    with pytest.raises(KeyboardInterrupt):
        fq.fit(again, RECORD)


def test_rounds_of_weights_end_too():
    _, count = whole()
    model, calls = plant(10**9)
    full = fq.fit(model, RECORD, weights="noise")
    assert not full.message.startswith("interrupted")
    # in the rounds that follow the first fit; one more would have a message of its own
    given_back = 0
    for after in range(count + 2, len(calls)):
        model, _ = plant(after)
        try:
            est = fq.fit(model, RECORD, weights="noise")
        except KeyboardInterrupt:
            # between the searches nothing is half done
            continue
        given_back += 1
        assert est.message.startswith("interrupted")
        assert est["a"] == pytest.approx(full["a"], rel=0.05)
    assert given_back


def test_what_goes_on_after_a_fit_ends_too(tmp_path):
    """A fleet kept the unfinished row, and cross-validation judged a start."""
    _, count = whole()
    for job in (
        lambda m: fq.fit_many(m, [RECORD, RECORD], tmp_path / "a.parquet", n_jobs=1, chunk=1),
        lambda m: fq.cross_validate(m, [RECORD, RECORD]),
        lambda m: fq.bootstrap(m, [RECORD] * 3, n=4),
    ):
        model, _ = plant(count - 4)
        with pytest.raises(KeyboardInterrupt):
            job(model)


def test_a_fit_beside_a_loop_ends_at_the_first_interruption():
    """The first look at whether noise comes back was interrupted, and all starts were made."""
    lag = fq.first_order().sampled(fq.ZeroOrderHold(5e-3))
    rng, r = np.random.default_rng(0), fq.white_noise(800, seed=1)
    u, y, x = np.zeros(800), np.zeros(800), 0.0
    for k in range(800):
        y[k] = x + 0.01 * rng.standard_normal()
        u[k] = r[k] - 0.3 * y[k]
        x = lag.phi[0, 0] * x + lag.gamma[0, 0] * u[k]
    record = fq.Record(u, y, 5e-3, reference=r)
    model, calls = plant(10**9)
    est = fq.fit(model, record)
    assert any("reference" in note for note in est.notes)
    for after in range(8, len(calls) - 3, 4):
        model, calls_here = plant(after)
        if len(calls_here) >= after:
            continue
        try:
            est = fq.fit(model, record)
        except KeyboardInterrupt:
            continue
        if est.message.startswith("interrupted"):
            assert len(calls_here) < after + 40, (after, len(calls_here))
            break
    else:
        pytest.fail("no interruption was met in a fit")
