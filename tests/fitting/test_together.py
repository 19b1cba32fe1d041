"""Records of one shape at once: the same cost, minimum and error bars, and none where in doubt."""

import tracemalloc

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.cost.many_costs import ManyCosts, one_shape
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.many.together import minima
from freqid.fitting.reading import Reading


def two_by_two(k, c):
    """Two masses on the ground and between them, pushed and seen at both."""
    K, z = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.zeros((2, 2))
    A = np.block([[z, np.eye(2)], [-k * K, -c * K]])
    return A, np.vstack([z, np.eye(2)]), np.hstack([np.eye(2), z]), None


TWO = fq.GreyBox(two_by_two, [fq.Parameter("k", 900.0), fq.Parameter("c", 2.0)])
PLANTS = {
    "lag": (fq.first_order(b=50, a=20), 0.01),
    "two-mass": (fq.two_mass(), 1e-3),
    "three masses": (fq.drivetrain(3), 1e-3),
    "two by two": (TWO, 0.01),
}


def runs(name, count=3, noise=0.02, samples=500, hold=fq.ZeroOrderHold):
    plant, dt = PLANTS[name]
    rng = np.random.default_rng(5)
    out = []
    for seed in range(count):
        u = rng.standard_normal((samples, plant.n_inputs))
        r = fq.simulate(plant, u, dt, hold=hold(dt))
        out.append(r.with_noise(noise * r.y.std(axis=0), seed=seed))
    return plant, out


def off(plant, by=1.2):
    return {p.name: by * p.value for p in plant.free_parameters}


@pytest.mark.parametrize("hold", [fq.ZeroOrderHold, fq.FirstOrderHold])
@pytest.mark.parametrize("name", PLANTS)
def test_the_cost_is_that_of_each(name, hold):
    plant, records = runs(name, hold=hold)
    readings = [Reading.of(r, skip_zero=plant.integrates) for r in records]
    experiments = [r.lines() for r in readings]
    assert one_shape(experiments)
    structure = GreyStructure(plant)
    x = structure.start * np.random.default_rng(0).uniform(0.8, 1.2, (3, len(structure.start)))
    cost, gradient, squares = ManyCosts(structure, experiments).normal(x, np.arange(3))
    for i, e in enumerate(experiments):
        point = Objective(structure, [e]).point(x[i])
        R, c = point.triangle[:-1, :-1], point.triangle[:-1, -1]
        assert cost[i] == pytest.approx(point.cost, rel=1e-12)
        np.testing.assert_allclose(gradient[i], R.T @ c, rtol=0, atol=1e-10 * abs(R.T @ c).max())
        np.testing.assert_allclose(squares[i], R.T @ R, rtol=0, atol=1e-10 * abs(R.T @ R).max())


@pytest.mark.parametrize("name", ["lag", "two-mass", "two by two"])
def test_the_minimum_and_its_error_bars_are_those_of_a_fit(name):
    plant, records = runs(name)
    found = minima(plant, records, {"start": off(plant)})
    done = [f for f in found if f is not None]
    assert len(done) >= 2
    for f, record in zip(found, records, strict=True):
        if f is None:
            continue
        est = fq.fit(plant, record, start=off(plant))
        assert f.cost == pytest.approx(est.cost, rel=1e-10)
        assert f.fit_percent == pytest.approx(est.fit_percent, rel=1e-9)
        for p, std in est.parameters["std"].items():
            assert abs(f.values[p] - est[p]) < 1e-4 * std
            assert f.std[p] == pytest.approx(std, rel=1e-4)


def test_a_record_comes_out_alike_whatever_stands_beside_it():
    plant, records = runs("two-mass", count=6)
    together = minima(plant, records, {"start": off(plant)})
    for record, one in zip(records, together, strict=True):
        alone = minima(plant, [record], {"start": off(plant)})[0]
        assert (alone is None) == (one is None)
        if one is not None:
            assert one.values == pytest.approx(alone.values, rel=1e-12)


def _with_another_mode(records, plant, dt):
    other = fq.GreyBox(
        lambda w: ([[0, 1], [-(w**2), -0.02 * w]], [[0], [1]], [[1.0, 0]], None),
        [fq.Parameter("w", 300.0)],
    )
    out = []
    for r in records:
        y = fq.simulate(other, r.u, dt).y.reshape(r.y.shape)
        out.append(fq.Record(r.u, r.y + 0.1 * r.y.std() * y / y.std(), dt))
    return out


def _coloured(records, plant, dt):
    rng = np.random.default_rng(1)
    out = []
    for r in records:
        e = np.zeros(len(r.y))
        for i in range(1, len(e)):
            e[i] = 0.95 * e[i - 1] + rng.standard_normal()
        out.append(fq.Record(r.u, r.y + 0.05 * r.y.std() * (e / e.std()).reshape(r.y.shape), dt))
    return out


def _exact(records, plant, dt):
    return [fq.simulate(plant, r.u, dt) for r in records]


@pytest.mark.parametrize("doubt", [_with_another_mode, _coloured, _exact])
def test_what_is_in_doubt_is_left_to_a_search(doubt):
    plant, records = runs("two-mass")
    doubtful = doubt(records, plant, PLANTS["two-mass"][1])
    assert minima(plant, doubtful, {"start": off(plant)}) == [None] * 3
    row = fq.fit_many(plant, doubtful, start=off(plant), verdicts=False, progress=False).iloc[0]
    est = fq.fit(plant, doubtful[0], start=off(plant))
    assert row["k"] == est["k"]
    assert row["k_std"] == est.parameters["std"]["k"]


@pytest.mark.study
def test_far_starts_end_in_no_worse_minimum():
    plant, records = runs("three masses", count=4, noise=0.1)
    start = {p.name: p.value * 3.0 ** (-1) ** i for i, p in enumerate(plant.free_parameters)}
    for f, record in zip(minima(plant, records, {"start": start}), records, strict=True):
        if f is not None:
            assert f.cost <= fq.fit(plant, record).cost * (1 + 1e-6)


@pytest.mark.parametrize(
    "options",
    [{"hold": "estimate"}, {"weights": "noise"}, {"domain": "time"}, {"n_starts": 3}],
)
def test_options_that_a_batch_does_not_know_are_left_to_a_fit(options):
    plant, records = runs("lag")
    assert minima(plant, records, options) == [None] * 3


def test_records_with_more_than_their_samples_are_left_to_a_fit():
    plant, records = runs("lag")
    slow = [r.decimate(2, keep_input=True) for r in records]
    known = [r.with_conditions(q=1.0) for r in records]
    assert minima(plant, slow + known, {}) == [None] * 6


def test_a_mode_that_samples_cannot_see_is_left_to_a_search():
    """Sampled at 10 ms a mode of 70 Hz looks like one of 30 Hz: both explain the data alike."""

    def axis(w, g):
        return [[0, 1], [-(w**2), -0.05 * w]], [[0], [g * w**2]], [[1.0, 0]], None

    true = fq.GreyBox(axis, [fq.Parameter("w", 2 * np.pi * 30), fq.Parameter("g", 1.0)])
    r = fq.simulate(true, fq.white_noise(500, seed=0), 0.01)
    r = r.with_noise(0.02 * r.y.std(), seed=0)
    above = minima(true, [r], {"start": {"w": 2 * np.pi * 70.3}})[0]
    assert above is None or above.values["w"] < 2 * np.pi * 50
    assert minima(true, [r], {"start": {"w": 2 * np.pi * 31}})[0] is not None


def test_from_starts_up_and_down_one_search_shows_where_the_others_are():
    """Plain steps from 20 % up and down ran out of the numbers, and took the others along."""
    plant = fq.two_mass()
    clean = fq.simulate(plant, fq.chirp(10, 80, 1, 0.5e-3), 0.5e-3)
    records = [clean.with_noise(0.01 * float(clean.y.std()), seed=i) for i in range(24)]
    factors = (1.2, 1 / 1.2, 1.2, 1 / 1.2, 1.2)
    parameters = plant.free_parameters
    start = {p.name: p.value * f for p, f in zip(parameters, factors, strict=True)}
    found = minima(plant, records, {"start": start})
    done = [i for i, each in enumerate(found) if each is not None]
    assert len(done) >= 21
    for i in done[:6]:
        alone = fq.fit(plant, records[i], start=start)
        assert found[i].cost <= alone.cost * (1 + 1e-8)
        assert found[i].values["k"] == pytest.approx(alone["k"], rel=1e-5)


def test_of_long_records_a_part_of_the_lines_raises_no_more_doubts():
    """What parameters explain of a part of the lines was counted against them."""
    plant = fq.first_order()
    clean = fq.simulate(plant, fq.chirp(2, 60, 20, 1e-3), 1e-3)
    records = [clean.with_noise(0.01 * float(clean.y.std()), seed=i) for i in range(60)]
    found = minima(plant, records, {"start": {"b": 120.0, "a": 80.0}})
    assert sum(each is None for each in found) <= 5


def test_memory_does_not_grow_with_the_records():
    plant, records = runs("lag", count=320, samples=4000)
    own = records[0].u.nbytes + records[0].y.nbytes

    def fitted(count):
        """What is left of so many records more, and the most on the way."""
        tracemalloc.start()
        some = records[:count]
        table = fq.fit_many(plant, some, verdicts=False, n_jobs=1, chunk=count, progress=False)
        told = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert (table["error"] == "").all()
        return told

    # modules that are imported on the way
    fitted(9)
    most = {}
    for count in (160, 320):
        left, most[count] = fitted(count)
        # records that keep their lines grow to twice their own size
        assert left < 8 * own
    # all of a chunk at once were four times the records: 40 MB more
    assert most[320] < most[160] + 16 * own
