"""Parts of the kernel against closed forms, mpmath and loops."""

import mpmath
import numpy as np
import pytest

from freqid.lti import Plane, StateSpace, ZeroOrderHold, on_circle, points
from freqid.lti.holds import BandLimited, FirstOrderHold, InputHolds, Sampled
from freqid.lti.holds.phi import phi_functions
from freqid.lti.lifting import lifted_inputs
from freqid.lti.observability import observed, reduced
from freqid.lti.quadrature import _MOST, NODES, panel_nodes, resolved, unresolved


def test_points_lie_on_the_circle_and_off_it():
    angle = np.linspace(-7, 7, 50)
    np.testing.assert_allclose(on_circle(angle), np.exp(1j * angle), rtol=1e-15)
    damped = angle - 0.3j
    np.testing.assert_allclose(on_circle(damped), np.exp(0.3) * np.exp(1j * angle), rtol=1e-14)
    omega = np.array([1.0, 4.0])
    np.testing.assert_allclose(points(omega, ZeroOrderHold(0.1)), np.exp(0.1j * omega))
    np.testing.assert_allclose(points(omega, BandLimited()), 1j * omega)


@pytest.mark.parametrize("a", [0.0, 0.4, -0.7])
def test_factors_of_a_plane_are_those_of_its_map(a):
    plane, z = Plane(a), np.exp(1j * np.linspace(0.1, 3, 7))
    w = plane.points(z)
    np.testing.assert_allclose(np.abs(w), 1, rtol=1e-13)
    # 1/(z − p) and z/(z − p), p = (q + a)/(1 + a q), are (1 + a w) and (w + a) over (w − q), up to
    # a factor
    q = 0.2
    p = (q + a) / (1 + a * q)
    one = plane.input_factor(w) / (w - q) * (z - p)
    other = plane.free_factor(w) / (w - q) * (z - p) / z
    np.testing.assert_allclose(one, one[0], rtol=1e-12)
    np.testing.assert_allclose(other, one[0], rtol=1e-12)


EXTREMES = [-800, -400.2, -400, -5, -3.9, -1e-3, 0, 1e-3, 2, 3.9 + 0.5j, 5, 320, 320.3, 320.3]


def test_phi_functions_of_arguments_far_from_zero_and_close_to_one_another():
    x = np.array(EXTREMES, complex)
    value, difference = phi_functions(x)

    def exact(k, a):
        if a == 0:
            return mpmath.mpf(1) / [1, 1, 2][k]
        e = mpmath.exp(a)
        return [e, (e - 1) / a, ((e - 1) / a - 1) / a][k]

    with mpmath.workdps(60):
        at = [mpmath.mpc(v) for v in x.tolist()]
        for k in range(3):
            f = [exact(k, a) for a in at]
            np.testing.assert_allclose(value[k], np.array(f, complex), rtol=1e-13)
            for i, a in enumerate(at):
                for j, b in enumerate(at):
                    if a == b:
                        d = mpmath.diff(lambda s, k=k: exact(k, s), a, h=mpmath.mpf("1e-25"))
                    else:
                        d = (f[i] - f[j]) / (a - b)
                    assert abs(difference[k][i, j] - complex(d)) <= 1e-12 * abs(complex(d)) + 1e-300


def test_polynomials_are_integrated_exactly_and_panels_split_where_they_must():
    panels = np.array([[0.0, 1.0], [1.0, 3.0]])
    x, w = panel_nodes(panels)
    for power in range(2 * NODES):
        assert w @ x**power == pytest.approx(3 ** (power + 1) / (power + 1), rel=1e-12)
    assert unresolved(x**12).max() < 1e-9 * 3**12
    assert unresolved(x**15).max() > 1e-9
    # one panel is enough for one function and not for the other
    found = resolved(panels, lambda s: np.array([s, np.sqrt(np.abs(s - 2))]))
    assert np.all(found[1:, 0] == found[:-1, 1])
    assert found[0].tolist() == [0, 1]
    x, w = panel_nodes(found)
    assert w @ np.sqrt(np.abs(x - 2)) == pytest.approx(2 / 3 * (2**1.5 + 1), 1e-6)
    # a function that is nowhere smooth does not split them for ever
    rng = np.random.default_rng(0)
    wild = resolved(panels, lambda s: rng.standard_normal((1, len(s))))
    assert _MOST / 4 < len(wild) <= _MOST
    assert resolved(panels, lambda s: np.zeros((2, len(s)))).shape == (2, 2)
    assert len(resolved(panels, lambda s: np.full((1, len(s)), np.nan))) == 2


@pytest.mark.parametrize("hold", [ZeroOrderHold(0.1), FirstOrderHold(0.1)])
def test_lifted_inputs_are_those_of_so_many_steps(hold):
    rng = np.random.default_rng(1)
    n, m, P, M = 3, 2, 4, 5
    A, B = rng.standard_normal((n, n)) - 2 * np.eye(n), rng.standard_normal((n, m))
    change = Sampled(*(rng.standard_normal((P, *S.shape)) for S in (A, B, B)))
    step = Sampled(*(*hold.sampled(A, B), None)[:3])
    if step.gamma_next is None:
        change = change._replace(gamma_next=None)
    phi, dphi = step.phi, change.phi
    powers = [np.eye(n)]
    dpowers = [np.zeros((P, n, n))]
    for _ in range(M):
        dpowers.append(dpowers[-1] @ phi + powers[-1] @ dphi)
        powers.append(powers[-1] @ phi)
    gamma, following, dgamma, dfollowing = lifted_inputs(
        step, change, np.array(powers), np.array(dpowers)
    )
    u = rng.standard_normal((M + 1, m))

    def stepped(e):
        S = Sampled(
            *(None if a is None else a + e * d[2] for a, d in zip(step, change, strict=True))
        )
        x = np.zeros(n)
        for k in range(M):
            x = S.phi @ x + S.gamma @ u[k]
            x = x if S.gamma_next is None else x + S.gamma_next @ u[k + 1]
        return x

    ours = gamma @ u[:M].ravel()
    slope = dgamma[2] @ u[:M].ravel()
    if following is not None:
        later = np.concatenate([u[M], np.zeros((M - 1) * m)])
        ours, slope = ours + following @ later, slope + dfollowing[2] @ later
    np.testing.assert_allclose(ours, stepped(0), rtol=1e-12)
    np.testing.assert_allclose(slope, (stepped(1e-6) - stepped(-1e-6)) / 2e-6, rtol=1e-7)


def test_states_that_no_output_shows_are_left_out_and_no_others():
    rng = np.random.default_rng(2)
    A = rng.standard_normal((5, 5)) - 3 * np.eye(5)
    A[:3, 3:] = 0
    B, C = rng.standard_normal((5, 2)), np.zeros((1, 5))
    C[0, :3] = rng.standard_normal(3)
    T = rng.standard_normal((5, 5))
    hidden = StateSpace(T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), np.zeros((1, 2)))
    W, X = observed(hidden)
    assert W.shape == (3, 5)
    np.testing.assert_allclose(W @ X, np.eye(3), atol=1e-10)
    small = reduced(hidden, W, X)
    x = rng.standard_normal(5)
    for s in (0.3j, 2j, 1 + 5j):
        for right, seen in ((hidden.B, small.B), (x[:, None], W @ x[:, None])):
            full = hidden.C @ np.linalg.solve(s * np.eye(5) - hidden.A, right)
            np.testing.assert_allclose(
                small.C @ np.linalg.solve(s * np.eye(3) - small.A, seen), full, rtol=1e-8
            )
    assert observed(hidden, least=4)[0].shape == (4, 5)
    # an output that shows everything, faintly
    faint = StateSpace(A, B, np.array([[1.0, 1, 1, 1e-6, 1e-6]]), np.zeros((1, 2)))
    np.testing.assert_array_equal(observed(faint)[0], np.eye(5))


def test_inputs_with_holds_of_their_own():
    zoh, foh = ZeroOrderHold(0.1), FirstOrderHold(0.1)
    both = InputHolds.joined([zoh, foh, zoh])
    assert InputHolds.joined([zoh, zoh]) == zoh
    assert both.of([0, 2]) == zoh
    assert both.of([1, 2]) == InputHolds((foh, zoh))
    assert InputHolds.each(both, 3) == (zoh, foh, zoh)
    assert InputHolds.each(zoh, 2) == (zoh, zoh)
    mixed = InputHolds((BandLimited(), zoh, BandLimited(), foh))
    assert mixed.groups == [(zoh, [1]), (foh, [3]), (BandLimited(), [0, 2])]
