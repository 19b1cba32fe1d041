"""What the cost is made of, piece by piece: closed forms, numpy and scipy, differences."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy

from freqid.fitting.cost.box_distance import BoxDistance, Surroundings
from freqid.fitting.cost.charts import Chart, _kron, balanced, from_plane, to_plane
from freqid.fitting.cost.lines import Lines
from freqid.fitting.cost.log_responses import LogResponse
from freqid.fitting.cost.many_costs import finite
from freqid.fitting.cost.noise_ends import noise_ends
from freqid.fitting.cost.periodic_experiments import PeriodicExperiment
from freqid.fitting.cost.priors import Prior
from freqid.lti import Plane, StateSpace, ZeroOrderHold
from freqid.models import Parameter

Z = np.exp(1j * np.linspace(0.05, 3.1, 9))


def sampled(seed, n=4, m=2, p=3, radius=0.9):
    """A random sampled plant with poles within a radius."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    return StateSpace(
        A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m))
    )


def response(model, z=Z, factor=1.0):
    A, B, C, D = model
    resolvent = np.linalg.inv(z[:, None, None] * np.eye(len(A)) - A)
    return C @ resolvent @ B * np.reshape(factor, (-1, 1, 1)) + D


def test_kroneckers_product():
    rng = np.random.default_rng(0)
    A, B = rng.standard_normal((3, 2)), rng.standard_normal((4, 5))
    np.testing.assert_allclose(_kron(A, B), np.kron(A, B), rtol=1e-15)


@pytest.mark.parametrize("a", [0.0, 0.3, 0.8, -0.5])
def test_a_model_in_another_plane_has_the_same_response(a):
    model, plane = sampled(1), Plane(a)
    moved = to_plane(model, plane)
    w = plane.points(Z)
    np.testing.assert_allclose((w + a) / (1 + a * w), Z, rtol=1e-13)
    np.testing.assert_allclose(response(moved, w, 1 + a * w), response(model), rtol=1e-10)
    for before, after in zip(model, from_plane(moved, plane), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-10, atol=1e-12)


def test_balanced_models_have_equal_gramians():
    model = sampled(2)
    A, B, C, D = balanced(model)
    reach = scipy.linalg.solve_discrete_lyapunov(A, B @ B.T)
    observe = scipy.linalg.solve_discrete_lyapunov(A.T, C.T @ C)
    np.testing.assert_allclose(reach, observe, atol=1e-9 * np.abs(reach).max())
    np.testing.assert_allclose(reach, np.diag(np.diag(reach)), atol=1e-9 * np.abs(reach).max())
    np.testing.assert_allclose(response(StateSpace(A, B, C, D)), response(model), rtol=1e-9)


def test_an_unstable_model_is_balanced_between_its_ends():
    A, B, C, D = sampled(3, radius=1.2)
    even = balanced(StateSpace(A, 100 * B, C, D))
    assert np.linalg.norm(even.B) == pytest.approx(np.linalg.norm(even.C))
    np.testing.assert_allclose(response(even), response(StateSpace(A, 100 * B, C, D)), rtol=1e-12)


@pytest.mark.parametrize("a", [0.0, 0.6])
def test_a_chart_has_as_many_coordinates_as_the_model_and_the_derivatives_of_differences(a):
    model, plane, dt = sampled(4), Plane(a), 0.01
    chart = Chart(to_plane(model, plane), True, plane, dt)
    n, m, p = 4, 2, 3
    assert chart.size == n * (m + p) + m * p
    # at right angles to every change of states
    rng = np.random.default_rng(0)
    A, B, C, _ = chart.centre
    for _ in range(3):
        T = rng.standard_normal((n, n))
        change = [A @ T - T @ A, -T @ B, C @ T]
        moved = chart.derivative
        inner = sum((d * c).sum(axis=(1, 2)) for d, c in zip(moved[:3], change, strict=True))
        np.testing.assert_allclose(inner, 0, atol=1e-10)
    x, omega = 1e-3 * rng.standard_normal(chart.size), np.angle(Z) / dt
    G, dG = chart.response(x, omega, None)
    here = chart.in_z(x)
    np.testing.assert_allclose(np.moveaxis(G, -1, 0), response(here), rtol=1e-9)
    poles, dpoles = chart.poles(x)
    seen = np.linalg.eigvals(here.A)
    np.testing.assert_allclose(
        np.sort_complex(np.exp(poles * dt)), np.sort_complex(seen), rtol=1e-9
    )
    for i in (0, 7, chart.size - 1):
        step = np.zeros(chart.size)
        step[i] = 1e-6
        up, down = (
            chart.response(x + step, omega, None)[0],
            chart.response(x - step, omega, None)[0],
        )
        np.testing.assert_allclose(dG[i], (up - down) / 2e-6, atol=1e-6 * np.abs(G).max())
        gap = chart.poles(x + step)[0] - chart.poles(x - step)[0]
        np.testing.assert_allclose(dpoles[:, i], gap / 2e-6, atol=1e-5 * np.abs(poles).max())


def lines(weight=None, aliases=2):
    rng = np.random.default_rng(5)
    K = 40
    omega = np.linspace(1, 20, K)
    U = rng.standard_normal((2, 1, K * aliases)) + 1j * rng.standard_normal((2, 1, K * aliases))
    Y = rng.standard_normal((3, 1, K)) + 1j * rng.standard_normal((3, 1, K))
    scale = np.ones((3, 1, K)) if weight is None else weight
    return Lines.weighted(omega, np.repeat(omega, aliases), U, Y, scale), U, Y


def test_one_weight_for_all_channels_is_in_the_data():
    weight = np.broadcast_to(np.linspace(1, 3, 40), (3, 1, 40))
    found, U, Y = lines(weight)
    assert found.inside
    np.testing.assert_allclose(found.Y, Y * weight)
    np.testing.assert_allclose(found.U, U * np.repeat(weight[0, 0], 2))
    np.testing.assert_allclose(found.measured()[1], Y)
    np.testing.assert_allclose(found.error(Y), Y)
    own = weight * np.array([1, 2, 3])[:, None, None]
    apart, U, Y = lines(own)
    assert not apart.inside
    np.testing.assert_allclose(apart.U, U)
    np.testing.assert_allclose(apart.rows(Y)[::2], (Y * own).ravel().real)
    np.testing.assert_allclose(apart.rows(Y)[1::2], (Y * own).ravel().imag)
    assert found.strongest().tolist() == [
        int(2 * k + np.argmax(np.abs(found.U[:, 0, 2 * k : 2 * k + 2]).sum(axis=0)))
        for k in range(40)
    ]


def test_some_lines_stand_for_all():
    found, _, _ = lines()
    kept, weight = found.spread(0.25, evenly=True)
    assert len(kept) == 10
    assert weight.sum() == 40
    some = found.some(kept, np.sqrt(weight))
    np.testing.assert_allclose(some.Y, found.Y[..., kept] * 2)
    both = np.stack([2 * kept, 2 * kept + 1], axis=1).ravel()
    np.testing.assert_allclose(some.U, found.U[..., both] * 2)
    # few lines that are driven: half of the part is theirs
    U = np.full((1, 1, 40), 1e-6 + 0j)
    U[..., 10:14] = 1
    few = Lines.weighted(found.omega, found.omega, U, U, np.ones((1, 1, 40)))
    kept, weight = few.spread(0.2, evenly=False)
    assert {10, 11, 12, 13} <= set(kept.tolist())
    assert len(kept) == 8
    assert weight[(kept >= 10) & (kept < 14)].tolist() == [1, 1, 1, 1]
    assert weight.sum() == 40
    # lines without weight stand for nothing
    scale = np.ones((1, 1, 40))
    scale[..., ::2] = 0
    half = Lines.weighted(found.omega, found.omega, U, U, scale)
    assert (half.spread(0.5, evenly=True)[0] % 2 == 1).all()


@pytest.mark.parametrize("n", [500, 501])
def test_the_past_of_noise_is_that_of_its_autoregression(n):
    """Weights |1 − 0.9 z⁻¹|² whiten AR(0.9) noise; z⁻ʲ/A is what its past leaves."""
    number = np.arange(n // 2 + 1)
    z = np.exp(2j * np.pi * number / n)
    A = 1 - 0.9 / z
    shapes = noise_ends(number, n, np.abs(A)[None] ** 2)
    assert 1 <= len(shapes) <= 3
    for j, shape in enumerate(shapes):
        np.testing.assert_allclose(shape[0], z**-j / A, rtol=1e-6)
    two = noise_ends(number, n, np.array([np.abs(A) ** 2, np.ones(len(A))]))
    assert two.shape[1:] == (2, len(A))
    # each is of one output
    assert all((np.abs(s).max(axis=1) > 0).sum() == 1 for s in two)
    # a longer memory takes more of them
    B = (1 - 0.9 / z) * (1 + 0.8 / z)
    assert len(noise_ends(number, n, np.abs(1 / B)[None] ** 2)) > len(shapes)


@pytest.mark.parametrize(("p", "freedom"), [(1, 5), (2, 7), (3, 12)])
def test_what_an_estimated_covariance_adds_to_residuals_and_estimates(p, freedom):
    """Complex Wishart matrices, drawn: the mean of e* S⁻¹ e, and the scatter of a weighted mean."""
    rng = np.random.default_rng(0)
    draws = 20_000

    def normal(*shape):
        return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)

    X = normal(draws, p, freedom)
    S = X @ X.conj().swapaxes(-1, -2) / freedom
    e = normal(draws, p, 1)
    whole = (e.conj().swapaxes(-1, -2) @ np.linalg.solve(S, e)).real.ravel()
    inverse = np.linalg.inv(S)
    square = (inverse @ inverse).trace(axis1=1, axis2=2).real.mean() / p
    mean = inverse.trace(axis1=1, axis2=2).real.mean() / p

    class Data:
        response = np.zeros((p, 1, 1))

    Data.freedom = freedom
    experiment = PeriodicExperiment(Data, ZeroOrderHold(0.1))
    assert experiment.level == pytest.approx(whole.mean() / (2 * p), rel=0.05)
    assert experiment.inflation == pytest.approx(square / mean**2, rel=0.1)
    Data.freedom = p
    assert experiment.level == experiment.inflation == np.inf
    Data.freedom = p + 1
    assert experiment.inflation == np.inf


def test_points_that_could_not_be_computed():
    jacobian = np.zeros((4, 2, 3))
    jacobian[1, 1, 2] = np.nan
    cost = np.array([1.0, 1.0, np.inf, 0.0])
    found = finite(SimpleNamespace(cost=cost, jacobian=jacobian))
    assert found.dtype == bool
    assert found.tolist() == [True, False, False, True]


def test_the_error_of_a_logarithm():
    rng = np.random.default_rng(6)
    measured = rng.standard_normal((2, 1, 5)) + 1j * rng.standard_normal((2, 1, 5))
    weight = rng.uniform(0.5, 2, measured.shape)
    weight[0, 0, 1] = 0
    target = LogResponse(np.arange(1.0, 6), measured, ZeroOrderHold(0.1), weight)
    G = measured * np.exp(0.3 + 0.7j)
    expected = (0.3 + 0.7j) * weight.ravel()
    np.testing.assert_allclose(target.error(G).view(complex), expected, rtol=1e-12)
    assert target.energy == target.n_rows == 20
    # derivatives are those of differences
    d = rng.standard_normal((1, 2, 1, 5)) + 1j * rng.standard_normal((1, 2, 1, 5))
    gap = (target.error(G + 1e-6 * d[0]) - target.error(G - 1e-6 * d[0])) / 2e-6
    np.testing.assert_allclose(target.relative(G, d)[0], gap, atol=1e-8)
    # a model that says nothing is far off, and leads nowhere
    silent = G.copy()
    silent[1, 0, 2] = 0
    error = target.error(silent).view(complex)
    assert error[7].real == pytest.approx(np.log(1e-8) * weight[1, 0, 2])
    assert target.relative(silent, d).view(complex)[0, 7] == 0


def test_the_distance_from_a_black_box_is_that_of_its_chart():
    rng = np.random.default_rng(7)
    U, K = 3, 8
    by = rng.standard_normal((U, 1, 1, K)) + 1j * rng.standard_normal((U, 1, 1, K))
    R = np.triu(rng.standard_normal((U, U))) + 3 * np.eye(U)
    G = rng.standard_normal((1, 1, K)) + 0j
    box = BoxDistance(Surroundings(np.arange(1.0, K + 1), G, by, R), ZeroOrderHold(0.1))
    step = rng.standard_normal(U)
    moved = G + np.tensordot(step, by, 1)
    rows = box.error(moved)
    assert rows @ rows == pytest.approx(np.sum((R @ step) ** 2))
    np.testing.assert_allclose(box.relative(by).T @ step, rows, atol=1e-12)
    # what no black box explains counts, too
    outside = box.error(G + 1j * np.abs(G))
    assert outside @ outside > 1
    nothing = box.error(0 * G)
    assert box.energy == pytest.approx(nothing @ nothing)


def test_a_prior_draws_as_its_precision_says():
    parameters = [
        Parameter("a", 1.0), Parameter("b", 2.0, prior=(3.0, 0.5)),
        Parameter("c", 1.0, prior=(0, 2)),
    ]  # fmt: skip
    scale = np.array([1.0, 2.0, 10.0])
    prior = Prior.of(parameters, scale, 4.0)
    theta = np.array([0.3, 2.2, 5.0])
    rows = prior.rows(theta / scale)
    np.testing.assert_allclose(rows[:, -1], 2 * np.array([(2.2 - 3) / 0.5, (5 - 0) / 2]))
    np.testing.assert_allclose(rows[:, :-1], 2 * np.array([[0, 2 / 0.5, 0], [0, 0, 10 / 2]]))
    held = prior.held(1, 2.2 / 2)
    np.testing.assert_allclose(held.rows(np.array([0.3, 0.5]))[:, -1], rows[:, -1])
    assert Prior.of(parameters[:1], scale[:1], 1.0) is None
