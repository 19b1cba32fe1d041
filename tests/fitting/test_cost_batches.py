"""Many points at once are each of them alone, and are not computed one by one behind one's back."""

import dataclasses

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.cost.many_costs import one_shape
from freqid.fitting.cost.many_starts import many_starts
from freqid.fitting.cost.noise_ends import noise_ends
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.places import Place
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.cost.time_experiments import _independent
from freqid.fitting.reading import Reading
from freqid.lti import ZeroOrderHold, rounding, sampled_response
from freqid.lti.state_space import StateSpace
from tests.robots.test_logs import simulated

OMEGA = 2 * np.pi * np.linspace(5, 90, 30)
HOLD = ZeroOrderHold(1e-3)


def alone(self, *args, **options):
    raise AssertionError("computed one by one")


def scattered(structure, count=4):
    rng = np.random.default_rng(1)
    return structure.start * rng.uniform(0.8, 1.2, (count, len(structure.start)))


def assert_each_alone(structure, found, points, place=0):
    G, dG = found
    for i, x in enumerate(points):
        one, d = sampled_response(structure.realise(x).for_place(place), OMEGA, HOLD)
        np.testing.assert_allclose(G[i], one, rtol=1e-9)
        np.testing.assert_allclose(dG[i], d, rtol=1e-6, atol=1e-9 * np.abs(d).max())


def test_responses_of_many_points(monkeypatch):
    structure = GreyStructure(fq.two_mass(Ja=3e-3, k=2e4))
    points = scattered(structure)
    assert_each_alone(structure, structure._one_by_one(points, OMEGA, HOLD), points)
    monkeypatch.setattr(GreyStructure, "_one_by_one", alone)
    assert_each_alone(structure, structure.sensitivities(points, OMEGA, HOLD), points)


def test_responses_of_many_points_at_a_place(monkeypatch):
    places = [Place(0, {}, {}), Place(1, {}, {"Ja": 5e-3})]
    structure = PlacedStructure(fq.two_mass(), None, places, separate=("fm",))
    points = scattered(structure)
    monkeypatch.setattr(GreyStructure, "_one_by_one", alone)
    for place in (0, 1):
        found = structure.sensitivities(points, OMEGA, HOLD, place)
        assert_each_alone(structure, found, points, place)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_cost_of_several_experiments_is_their_sum(hold):
    plant = fq.two_mass()
    structure, records = GreyStructure(plant), []
    for seed, low in ((1, 10), (2, 20)):
        record = fq.simulate(plant, fq.chirp(low, 80, 2, 1e-3), 1e-3).decimate(2)
        records.append(record.with_noise(0.02 * record.y.std(), seed=seed))
    experiments = [Reading.of(record, hold, None).lines() for record in records]
    objective = Objective(structure, experiments)
    x = scattered(structure)
    cost, gradient, curvature = many_starts(structure, experiments, 4).normal(x, np.arange(4))
    for i, row in enumerate(x):
        point = objective.point(row)
        assert cost[i] == pytest.approx(point.cost, rel=1e-9)
        assert gradient[i] == pytest.approx(point.jacobian.T @ point.residual, rel=1e-6)
        assert curvature[i] == pytest.approx(point.jacobian.T @ point.jacobian, rel=1e-6)


def test_only_experiments_that_differ_in_data_alone_are_of_one_shape():
    record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 2, 1e-3), 1e-3)
    one = Reading.of(record, None, None).lines()
    assert one_shape([one, Reading.of(record.with_noise(1.0, seed=1), None, None).lines()])
    others = {
        "hold": Reading.of(record, "foh", None).lines(),
        "lines": Reading.of(record, None, (20, 60)).lines(),
        "length": Reading.of(record.slice(0, 1.5), None, None).lines(),
        "lift": dataclasses.replace(one, lift=2),
        "added": one.with_rows(np.ones((1, one.n_rows))),
    }
    assert [name for name, other in others.items() if one_shape([one, other])] == []
    folded = Reading.of(record.decimate(2, keep_input=True), None, None).lines()
    assert not one_shape([folded])


def test_late_inputs_turn_with_their_frequency():
    record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 2, 1e-3), 1e-3)
    for data in (record, record.decimate(2, keep_input=True)):
        one = Reading.of(data, None, None).lines()
        late = one.behind(0.004)
        turn = np.exp(-0.004j * one.lines.omega_input.ravel())
        np.testing.assert_allclose(late.lines.U, one.lines.U * turn)
        np.testing.assert_allclose(late.points.U, one.points.U * turn)
        np.testing.assert_array_equal(late.lines.Y, one.lines.Y)


def test_lines_without_weight_are_measured_as_they_are():
    frf = fq.FrequencyResponse(np.arange(1.0, 6), np.arange(1, 6) + 1j, variance=np.ones(5))
    lines = Reading.of(frf).lines().lines
    scale = lines.scale.copy()
    scale[..., 2] = 0
    silent = dataclasses.replace(lines, scale=scale, Y=lines.Y * (scale > 0))
    omega, values, weight = silent.measured()
    np.testing.assert_allclose(omega, 2 * np.pi * np.arange(1, 6))
    assert np.isfinite(values).all()
    np.testing.assert_array_equal(weight, scale)


def test_the_filter_of_noise_has_the_size_of_its_weights():
    number = np.arange(251)
    z = np.exp(2j * np.pi * number / 500)
    A = 3 * (1 - 0.9 / z)
    shapes = noise_ends(number, 500, np.abs(A)[None] ** 2)
    np.testing.assert_allclose(shapes[0, 0], 1 / A, rtol=1e-6)


def test_motions_that_depend_on_one_another_are_combined():
    rng = np.random.default_rng(0)
    real, other = rng.standard_normal((2, 50))
    # a real motion, one that is a thousandth of it, and a pair
    motions = np.array([real, 1e-3 * real, other, 0 * real, 0 * real, 2 * other])
    mix, rows = _independent(motions, 3)
    np.testing.assert_allclose(rows, mix.T @ motions, rtol=1e-12)
    assert len(rows) == 2
    assert np.linalg.matrix_rank(np.concatenate([rows, motions])) == 2


def test_rounding_is_asked_of_rates_that_lie_far_apart_or_close():
    def told(*rates, beside=0.0):
        T = np.linalg.qr(np.random.default_rng(3).standard_normal((len(rates), len(rates))))[0]
        A = T @ (beside * np.diag(np.ones(len(rates) - 1), 1) - np.diag(rates)) @ T.T
        ones = np.ones((len(rates), 1))
        return rounding(StateSpace(A, ones, ones.T, np.zeros((1, 1))), HOLD, np.array([1.0]))

    assert told(1.0, 30.0) == 0
    assert told(1.0, 300.0) > 0
    assert told(0.01, 3.0) > 0
    # lags in a row, whose eigenvectors are nearly parallel
    assert told(5.0, 5.001, beside=1.0) > 0
    assert told(5.0, 5.1, beside=1.0) == 0
    assert told(5.0, 5.001) > 0
    assert told(5.0, 5.1) == 0


def two_lags(a, b, c):
    return [[-a, 0], [0, -b]], [[a, 0], [0, c]], [[1, 1]], [[0, 0]]


LAGS = [fq.Parameter("a", 5.0), fq.Parameter("b", 20.0), fq.Parameter("c", 8.0)]
OFF = {"a": 6.0, "b": 17.0, "c": 9.0}


def assert_found(est, rtol):
    np.testing.assert_allclose(est.values, [5, 20, 8], rtol=rtol)


@pytest.mark.parametrize("late", [(0.02, -0.03), (0.01, -0.01), (0.024, -0.016)])
def test_one_input_late_and_another_early(late):
    """What both ends of the record do not hold is left open, and nothing else."""
    u = np.column_stack([fq.white_noise(900, seed=s) for s in (1, 2)])
    plant = fq.GreyBox(two_lags, LAGS, input_delay=late)
    record = fq.simulate(plant, u, 0.01).slice(1, 7.5)
    assert_found(fq.fit(plant, record, start=OFF), 1e-8)


@pytest.mark.parametrize("straight", [False, True])
def test_two_inputs_at_stamps_of_their_own(straight):
    rng = np.random.default_rng(0)
    u = np.column_stack([fq.white_noise(600, seed=s) for s in (1, 2)])
    u_time = 1e-2 * (np.arange(600) + 0.3 * rng.random(600))
    y_time = 0.2 + 1.3e-2 * (np.arange(400) + 0.3 * rng.random(400))
    y = sum(
        simulated(fq.first_order(b=b, a=a), u_time, u[:, i], y_time, straight)
        for i, (b, a) in enumerate([(5, 5), (8, 20)])
    )
    record = fq.Record.from_logs(u_time, u, y_time, y)
    hold = "foh" if straight else "zoh"
    assert_found(fq.fit(fq.GreyBox(two_lags, LAGS), record, hold=hold, start=OFF), 1e-10)
