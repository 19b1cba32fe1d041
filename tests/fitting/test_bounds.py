"""Searches within bounds, beside scipy's own on the same residuals."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.cost.objective import Point
from freqid.fitting.search.bounded import within_bounds
from freqid.fitting.search.descent import minimise

DT = 4e-3


def bounded(**limits):
    """The paper's axis with bounds as users write them: nothing below zero."""
    plant = fq.two_mass()
    free = [p.name for p in plant.parameters if not p.fixed]
    return plant.with_bounds(**dict.fromkeys(free, (0.0, np.inf)) | limits)


def wrong_hold(noise=0.05, seed=0):
    """The paper's experiment at a slow rate, its hold forgotten: dampings want to be negative."""
    fine = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 10, 0.5e-3), 0.5e-3)
    slow = fine.decimate(8).with_noise(noise * fine.y.std(), seed=seed)
    return fq.Record(slow.u, slow.y, slow.dt)


def others(model, record, at):
    """The least cost that scipy's trust-region reflective finds from five starts beside ``at``."""
    objective = fq.fit(model, record, band=(10, 80), start=at, n_starts=1).minimum.objective
    structure, found = objective.structure, []
    x0 = np.ones(len(structure.names))
    for seed in range(5):
        begin = x0 * 1.3 ** np.random.default_rng(seed).uniform(-1, 1, len(x0))
        found.append(
            scipy.optimize.least_squares(
                lambda x: objective.point(x).residual,
                begin,
                jac=lambda x: objective.point(x).jacobian,
                bounds=(structure.lower, structure.upper),
                x_scale="jac",
                xtol=1e-15,
                ftol=1e-15,
                gtol=1e-15,
            )
        )
    return min(2 * f.cost for f in found)


def test_what_lies_on_a_bound_is_the_least_there():
    record = wrong_hold()
    free = fq.fit(fq.two_mass(), record, band=(10, 80))
    assert (free.values < 0).any()
    est = fq.fit(bounded(), record, band=(10, 80))
    on = est.values == 0
    assert on.any()
    assert est.cost > free.cost
    # on a bound the cost rises inwards, elsewhere it is flat
    point = est.minimum.point
    gradient = point.jacobian.T @ point.residual / np.linalg.norm(point.jacobian, axis=0)
    assert (gradient[on] > 0).all()
    assert np.abs(gradient[~on]).max() < 1e-5 * np.sqrt(point.cost)
    assert est.cost <= others(bounded(), record, dict(est.parameters["value"])) * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_bounds_that_do_not_bind_change_nothing(seed):
    rng = np.random.default_rng(seed)
    record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 4, 1e-3), 1e-3)
    record = record.with_noise(0.02 * record.y.std(), seed=seed)
    true = fq.two_mass().values
    free = [p.name for p in fq.two_mass().parameters if not p.fixed]
    start = {n: true[n] * 2 ** rng.uniform(-1, 1) for n in free}
    wide = bounded(**{n: (0.0, 5 * true[n]) for n in free})
    one, other = (fq.fit(m, record, band=(10, 80), start=start) for m in (fq.two_mass(), wide))
    assert other.cost == pytest.approx(one.cost, rel=1e-9)
    assert other.n_evaluations < 3 * one.n_evaluations + 30


def test_a_bound_on_which_nothing_can_be_computed_is_approached():
    """A mass that wants to be zero, where the matrices end: the fit says so, in time."""

    def matrices(m, c, k):
        if m <= 0:
            raise ValueError("no mass")
        return [[0, 1], [-k / m, -c / m]], [[0], [1 / m]], [[1, 0]], [[0]]

    def plant(m):
        parameters = [fq.Parameter(n, v, lower=0) for n, v in (("m", m), ("c", 2.0), ("k", 50.0))]
        return fq.GreyBox(matrices, parameters)

    lag = fq.first_order(b=0.5, a=25.0)
    record = fq.simulate(lag, fq.white_noise(800, seed=1), 0.01).with_noise(1e-4, seed=2)
    est = fq.fit(plant(0.05), record, n_starts=1)
    assert est["m"] < 1e-3
    assert est["k"] / est["c"] == pytest.approx(25, rel=0.02)
    assert est.n_evaluations < 400


@pytest.mark.parametrize("seed", range(10))
def test_an_estimate_on_its_bound_is_within_it(seed):
    """Bounds that no power of two divides, met by values that come back from units of their own."""
    rng = np.random.default_rng(seed)
    record = fq.simulate(fq.first_order(b=40.0, a=25.0), fq.white_noise(300, seed=seed), 0.01)
    top = {"b": 40.0 * rng.uniform(0.3, 0.9), "a": 25.0 * rng.uniform(0.3, 0.9)}
    model = fq.first_order(b=40.0, a=25.0).with_values(**{n: v * 0.9 for n, v in top.items()})
    model = model.with_bounds(**{n: (0.0, v) for n, v in top.items()})
    est = fq.fit(model, record, start={n: v * rng.uniform(0.1, 1) for n, v in top.items()})
    assert (est.values <= list(top.values())).all()
    assert np.isclose(est.values, list(top.values()), rtol=1e-6).any()


@pytest.mark.parametrize("seed", range(20))
def test_no_step_ends_a_last_digit_beyond_its_bound(seed):
    """From 90 to 1/30 a step's own digits end where the bound's go on: the fit was an error."""
    rng = np.random.default_rng(seed)
    A, wanted = rng.standard_normal((6, 3)), rng.uniform(-900, -1, 3)
    begin, lower = rng.uniform(10, 900, 3), rng.uniform(0.001, 0.1, 3)

    class Straight:
        """|A (x − wanted)|², whose minimum lies beyond the bounds."""

        rounding, n_evaluations, failure = 0.0, 0, None
        structure = SimpleNamespace(lower=lower, upper=np.full(3, np.inf))

        def point(self, x):
            assert (x >= lower).all(), (x - lower).tolist()
            left = A @ (x - wanted)
            R = np.linalg.qr(np.column_stack([A, left]), mode="r")
            return Point(R, [None], [float(left @ left)])

    x, _, how = within_bounds(Straight(), begin, 100)
    exact = scipy.optimize.lsq_linear(A, A @ wanted, (lower, np.inf), method="bvls")
    assert how == "minimum"
    assert x == pytest.approx(exact.x, rel=1e-6)
    assert (x == lower).any()


def test_where_nothing_can_be_computed_next_to_a_bound_the_start_is_what_ends():
    """A search pushed off its bound, where there is no plant, came back with the place it had been
    pushed to and the cost of the start: error bars met numbers that are none.
    """

    class Edge:
        """(x − 1)² + 1 at 0 and beyond 0.1, nothing in between."""

        rounding, n_evaluations, failure = 0.0, 0, ArithmeticError("no plant")
        structure = SimpleNamespace(lower=np.zeros(1), upper=np.full(1, np.inf))

        def point(self, x):
            if 0 < x[0] < 0.1:
                return None
            left = np.array([x[0] - 1, 1.0])
            R = np.linalg.qr(np.column_stack([[1.0, 0.0], left]), mode="r")
            return Point(R, [None], [float(left @ left)])

    found = minimise(Edge(), np.zeros(1))
    assert found.point.cost == Edge().point(found.x).cost


def test_a_value_that_its_units_make_small_is_at_no_bound():
    """A mass begun in kg where the data's unit makes it 1e-8 lies far inside of its bound 0."""
    lag = fq.first_order(b=40.0, a=25.0).with_bounds(b=(0.0, np.inf))
    record = fq.simulate(lag, fq.white_noise(800, seed=1), 0.01).with_noise(0.01)
    small = fq.Record(record.u, 1e-9 * record.y, record.dt)
    est = fq.fit(lag, small)
    assert est["b"] == pytest.approx(4e-8, rel=0.05)
    assert "edge of a bound" not in [w.kind for w in est.warnings]
    kept = lag.with_bounds(b=(-np.inf, np.inf)).with_values(b=33e-9).with_bounds(b=(30e-9, 35e-9))
    assert "edge of a bound" in [w.kind for w in fq.fit(kept, small).warnings]


def direct(through):
    """A lag with a direct term that is bounded to be positive."""
    return fq.GreyBox(
        lambda a, b, e: ([[-a]], [[b]], [[1.0]], [[e]]),
        [
            fq.Parameter("a", 25.0, lower=0),
            fq.Parameter("b", 40.0, lower=0),
            fq.Parameter("e", through, lower=min(through, 0.0)),
        ],
    )


@pytest.mark.study
def test_a_true_value_on_its_bound_is_no_doubt():
    """The data want it beyond in half of the records, by chance, and by two standard errors in one
    of 44; all ended in a doubt.
    """
    begun, said = direct(0.0).with_values(e=0.3), []
    for seed in range(40):
        record = fq.simulate(direct(0.0), fq.white_noise(400, seed=seed), 0.01)
        est = fq.fit(begun, record.with_noise(0.2, seed=seed))
        said.append([w for w in est.warnings if w.kind == "edge of a bound"])
        assert est.parameters.loc["e", "lower"] == 0 or not said[-1]
    at_it = [w for found in said for w in found]
    assert 10 <= len(at_it) <= 30
    serious = [w for w in at_it if w.severity == "serious"]
    assert len(serious) <= 3
    assert "less than two standard errors" in next(w for w in at_it if w.severity == "minor")


def test_a_value_that_the_data_want_beyond_its_bound_is_a_doubt():
    begun = direct(0.0).with_values(e=0.3)
    for seed in range(3):
        record = fq.simulate(direct(-0.3), fq.white_noise(400, seed=seed), 0.01)
        est = fq.fit(begun, record.with_noise(0.2, seed=seed))
        (said,) = [w for w in est.warnings if w.kind == "edge of a bound"]
        assert said.severity == "serious"
        assert est.verdict.grade != "trust"


def test_two_lags_that_are_alike_have_a_minimum():
    """Steps that were asked for along what both do met zero: "not converged", in 9 of 20."""

    def lags(g, t1, t2):
        return [[-1 / t1, 0], [1 / t2, -1 / t2]], [[g / t1], [0]], [[0, 1.0]], None

    def plant(**values):
        return fq.GreyBox(lags, [fq.Parameter(n, v, lower=0) for n, v in values.items()])

    true = plant(g=1.5, t1=0.02, t2=0.02)
    for seed in range(8):
        clean = fq.simulate(true, fq.white_noise(1500, seed=seed), 2e-3)
        est = fq.fit(plant(g=1.0, t1=0.015, t2=0.04), clean.with_noise(0.002, seed=seed))
        assert est.converged
        assert est["g"] == pytest.approx(1.5, rel=0.01)
        assert est["t1"] + est["t2"] == pytest.approx(0.04, rel=0.02)


@pytest.mark.parametrize("bounds", [(-200.0, -10.0), (-200.0, 0.0), (-np.inf, -10.0)])
def test_a_parameter_that_is_bounded_below_zero_is_meant_there(bounds):
    def lag(g, p):
        return [[-p]], [[1.0]], [[g]], [[0.0]]

    model = fq.GreyBox(lag, [fq.Parameter("g", -60.0), fq.Parameter("p", 6.0)])
    model = model.with_bounds(g=bounds)
    rng = np.random.default_rng(0)
    u = np.repeat(rng.standard_normal(100), 4)
    record = fq.simulate(model.with_values(g=-40.0, p=5.0), u, 0.01).with_noise(0.01, seed=1)
    est = fq.fit(model, record)
    assert est.values == pytest.approx([-40.0, 5.0], rel=0.01)
    assert est.verdict.grade == "trust", est.warnings
