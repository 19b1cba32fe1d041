"""The kernel against closed forms, scipy and extended precision, and its two routes compared."""

import mpmath
import numpy as np
import pytest

import freqid as fq
from freqid.lti.bases import basis_of
from freqid.lti.eigen_basis import EigenBasis
from freqid.lti.responses import points, response_and_derivatives
from freqid.lti.schur_basis import SchurBasis
from freqid.lti.state_space import Linearisation, StateSpace

OMEGA = 2 * np.pi * np.linspace(10, 80, 71)
HOLDS = [fq.ZeroOrderHold(5e-3), fq.FirstOrderHold(5e-3), fq.BandLimited()]


def test_first_order_closed_forms():
    b, a, h = 100.0, 100.0, 5e-3
    z = np.exp(1j * OMEGA * h)
    phi = np.exp(-a * h)
    zoh = b / a * (1 - phi) / (z - phi)
    g1, g2 = b / a * (1 - phi), b / a * (1 - (1 - phi) / (a * h))
    foh = (g1 - g2 + z * g2) / (z - phi)
    plant = fq.first_order(b, a)
    for hold, exact in zip(HOLDS, (zoh, foh, b / (1j * OMEGA + a)), strict=True):
        assert (
            np.abs(plant.frequency_response(OMEGA, hold).response[0, 0] / exact - 1).max() < 1e-13
        )


def test_continuous_response_is_that_of_control(plant):
    ours = plant.frequency_response(OMEGA).response
    theirs = plant.to_control()(1j * OMEGA)
    assert np.abs(ours[0, 0] / theirs - 1).max() < 1e-9


def exact_response(system, omega, hold):
    """Response by matrix exponentials and solves in 40 digits."""
    A, B, C, D = (mpmath.matrix(M.tolist()) for M in system)
    n, m = A.rows, B.cols
    if hold.name == "bl":
        phi, gamma, following, z = A, B, mpmath.zeros(n, m), mpmath.mpc(0, omega)
    else:
        h = mpmath.mpf(hold.period)
        X = mpmath.zeros(n + 2 * m)
        X[:n, :n], X[:n, n : n + m] = A * h, B * h
        X[n : n + m, n + m :] = mpmath.eye(m)
        E = mpmath.expm(X)
        phi, ramp = E[:n, :n], E[:n, n + m :]
        foh = hold.name == "foh"
        following = ramp if foh else mpmath.zeros(n, m)
        gamma = E[:n, n : n + m] - following
        z = mpmath.exp(mpmath.mpc(0, omega * hold.period))
    return C * mpmath.lu_solve_matrix(z * mpmath.eye(n) - phi, gamma + z * following) + D


def solve_matrix(M, R):
    out = mpmath.zeros(R.rows, R.cols)
    for j in range(R.cols):
        out[:, j] = mpmath.lu_solve(M, R[:, j])
    return out


mpmath.lu_solve_matrix = solve_matrix


@pytest.mark.parametrize("hold", [fq.ZeroOrderHold(0.4), fq.FirstOrderHold(0.4), fq.BandLimited()])
@pytest.mark.parametrize("kind", ["random", "defective", "unstable"])
def test_derivatives_against_central_differences_in_forty_digits(hold, kind, rng):
    n, m, p = 3, 2, 2
    shapes = [(n, n), (n, m), (p, n), (p, m)]
    at = [rng.standard_normal(s) for s in shapes]
    if kind == "defective":
        at[0] = np.array([[0.0, 1, 0], [0, 0, 1], [0, 0, 0]])
    if kind == "unstable":
        at[0] = at[0] + 2 * np.eye(n)
    direction = [rng.standard_normal(s) for s in shapes]
    lin = Linearisation(StateSpace(*at), StateSpace(*(d[None] for d in direction)))
    omega = np.array([0.7, 2.9])
    sampled = basis_of(*lin).through(hold)
    value, derivative = response_and_derivatives(sampled, points(omega, hold))
    with mpmath.workdps(40):
        step = mpmath.mpf("1e-12")
        for k, w in enumerate(omega):
            ends = []
            for sign in (1, -1):
                moved = [
                    mpmath.matrix(a.tolist()) + sign * step * mpmath.matrix(d.tolist())
                    for a, d in zip(at, direction, strict=True)
                ]
                ends.append(exact_response([np.array(M.tolist()) for M in moved], w, hold))
            exact = np.array(((ends[0] - ends[1]) / (2 * step)).tolist(), dtype=complex)
            middle = np.array(((ends[0] + ends[1]) / 2).tolist(), dtype=complex)
            assert np.abs(value[:, :, k] - middle).max() < 1e-11 * np.abs(middle).max()
            assert np.abs(derivative[0, :, :, k] - exact).max() < 1e-7 * np.abs(exact).max()


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("lift", [1, 4])
def test_both_routes_give_the_same(hold, lift, plant):
    if hold.name == "bl" and lift > 1:
        pytest.skip("a band-limited input has no samples to lift over")
    lin = plant.linearise(plant.values, ["Jm", "k", "Ja", "fm", "d"])
    bases = basis_of(*lin), SchurBasis(*lin)
    assert isinstance(bases[0], EigenBasis)
    z = np.exp(1j * OMEGA * 5e-3 * lift) if hold.name != "bl" else 1j * OMEGA
    results = []
    for basis in bases:
        sampled = basis.through(hold, lift)
        m = sampled.gamma.shape[-1]
        U = np.ones((m, 1, len(z))) * np.exp(1j * np.arange(m))[:, None, None]
        x = sampled.solve(z, sampled.drive(z, U))
        results.append((sampled.output(x, U), sampled.sensitivity(z, sampled.output_rows(z), x, U)))
    for a, b in zip(*results, strict=True):
        size = np.abs(a).max(axis=-1, keepdims=True)
        assert (np.abs(a - b) / size).max() < 1e-8


def test_a_double_integrator_takes_the_other_route():
    A = np.array([[0.0, 1], [0, 0]])
    at = StateSpace(A, np.array([[0.0], [1]]), np.array([[1.0, 0]]), np.zeros((1, 1)))
    basis = basis_of(at, StateSpace(*(np.zeros((0, *M.shape)) for M in at)))
    assert isinstance(basis, SchurBasis)
    h, omega = 0.1, np.array([1.0, 5.0])
    z = np.exp(1j * omega * h)
    exact = h**2 / 2 * (z + 1) / (z - 1) ** 2
    response, _ = response_and_derivatives(basis.through(fq.ZeroOrderHold(h)), z)
    assert np.abs(response[0, 0] / exact - 1).max() < 1e-12


def test_four_lightly_damped_modes_stay_accurate(rng):
    modes = np.array([20.0, 45.0, 80.0, 130.0])
    A = np.zeros((8, 8))
    for i, w in enumerate(modes):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-(w**2), -2 * 0.005 * w]]
    B, C = np.tile([[0.0], [1.0]], (4, 1)), np.tile([[1.0, 0.0]], (1, 4))
    T = rng.standard_normal((8, 8))
    Ti = np.linalg.inv(T)
    mixed = fq.GreyBox(lambda g: (T @ A @ Ti, T @ B * g, C @ Ti, None), [fq.Parameter("g", 1)])
    omega = np.linspace(5, 150, 400)
    exact = sum(1 / (w**2 - omega**2 + 2j * 0.005 * w * omega) for w in modes)
    assert np.abs(mixed.frequency_response(omega).response[0, 0] / exact - 1).max() < 1e-7


def test_user_functions_that_refuse_complex_numbers_get_differences(plant):
    def matrices(k):
        return [[0.0, 1.0], [-float(k), -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], None

    model = fq.GreyBox(matrices, [fq.Parameter("k", 4.0)])
    lin = model.linearise(model.values, ["k"])
    assert np.allclose(lin.derivative.A[0], [[0, 0], [-1, 0]], atol=1e-8)
    smooth = fq.GreyBox(
        lambda k: ([[0, 1], [-(k**2), -0.1]], [[0], [1]], [[1, 0]], 0), [fq.Parameter("k", 2.0)]
    )
    assert smooth._function.takes_complex(["k"])
    lin = smooth.linearise(smooth.values, ["k"])
    assert abs(lin.derivative.A[0, 1, 0] + 4) < 1e-15


def test_a_plant_that_is_not_finite_leaves_the_terminal_alone(capfd):
    """LAPACK itself writes there, past Python's own streams, when it balances what is no number."""
    one = np.ones((1, 1))
    at = StateSpace(-np.eye(2), np.array([[np.nan], [1.0]]), np.ones((1, 2)), one)
    basis_of(at)
    out, err = capfd.readouterr()
    assert out == err == ""
