"""Holds against scipy, python-control and high-precision exponentials."""

import mpmath
import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings, strategies as st

import freqid as fq
from freqid.lti.holds import phi_functions


def random_plant(kind, rng):
    n, m = 4, 2
    A = rng.standard_normal((n, n))
    if kind == "stable":
        A -= (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(n)
    elif kind == "unstable":
        A += (1 - np.linalg.eigvals(A).real.max()) * np.eye(n)
    elif kind == "defective":
        A = np.diag(np.ones(n - 1), 1)
    elif kind == "double integrator":
        A, n = np.array([[0.0, 1], [0, 0]]), 2
    return A, rng.standard_normal((n, m))


KINDS = ["stable", "unstable", "defective", "double integrator"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["zoh", "foh"])
def test_sampled_matrices_agree_with_scipy(kind, method, rng):
    A, B = random_plant(kind, rng)
    h = 0.3
    hold = {"zoh": fq.ZeroOrderHold, "foh": fq.FirstOrderHold}[method](h)
    C, D = rng.standard_normal((2, len(A))), rng.standard_normal((2, 2))
    Ad, Bd, _, Dd, _ = scipy.signal.cont2discrete((A, B, C, D), h, method)
    phi, gamma, gamma_next = hold.sampled(A, B)
    # scipy's state under a first-order hold is x − Γ⁺u, so inputs and feedthrough are compared
    scale = np.abs(Ad).max()
    assert np.abs(phi - Ad).max() < 1e-12 * scale
    assert np.abs(gamma + phi @ gamma_next - Bd).max() < 1e-12 * scale
    assert np.abs(D + C @ gamma_next - Dd).max() < 1e-12 * scale


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["zoh", "foh"])
def test_sampled_matrices_agree_with_fifty_digits(kind, method, rng):
    A, B = random_plant(kind, rng)
    n, m = B.shape
    h = 0.3
    with mpmath.workdps(50):
        size = n + m + (m if method == "foh" else 0)
        X = mpmath.zeros(size)
        X[:n, :n], X[:n, n : n + m] = mpmath.matrix(A) * h, mpmath.matrix(B) * h
        if method == "foh":
            X[n : n + m, n + m :] = mpmath.eye(m)
        exact = np.array(mpmath.expm(X).tolist(), dtype=float)
    phi, gamma, gamma_next = {"zoh": fq.ZeroOrderHold, "foh": fq.FirstOrderHold}[method](h).sampled(
        A, B
    )
    ramp = exact[:n, n + m :] if method == "foh" else 0
    scale = np.abs(exact[:n]).max()
    assert np.abs(phi - exact[:n, :n]).max() < 1e-12 * scale
    assert np.abs(gamma - (exact[:n, n : n + m] - ramp)).max() < 1e-12 * scale
    assert np.abs(gamma_next - ramp).max() < 1e-12 * scale


numbers = st.complex_numbers(max_magnitude=30, allow_nan=False, allow_infinity=False)


@given(numbers, numbers, st.floats(0, 1))
@settings(max_examples=150, deadline=None)
def test_phi_functions_to_rounding(x, y, mix):
    y = x + mix**8 * (y - x)  # often close together, where differences cancel
    value, difference = phi_functions(np.array([x, y]))
    with mpmath.workdps(150):
        tiny = mpmath.mpf("1e-40")
        X, Y = mpmath.mpc(x) + tiny, mpmath.mpc(y) - tiny

        def phi(k, z):
            f = [mpmath.exp(z), (mpmath.exp(z) - 1) / z]
            return f[k] if k < 2 else (f[1] - 1) / z

        for k in range(3):
            size = abs(phi(k, X)) + abs(phi(k, Y)) + 1e-3
            assert abs(value[k][0] - phi(k, X)) < 1e-13 * size
            exact = (phi(k, X) - phi(k, Y)) / (X - Y)
            assert abs(difference[k][0, 1] - exact) < 1e-12 * size


def test_a_hold_has_its_own_period(plant):
    omega = np.array([50.0, 300.0])
    fine = plant.frequency_response(omega, fq.ZeroOrderHold(0.5e-3)).response
    coarse = plant.frequency_response(omega, fq.ZeroOrderHold(5e-3)).response
    # a zero-order hold delays by half its period
    phase = np.angle(coarse / fine)
    assert np.allclose(phase, -omega * (5e-3 - 0.5e-3) / 2, rtol=0.05)


@pytest.mark.parametrize("bad", [0, -1, np.nan, np.inf, "x", True])
def test_a_period_must_be_positive(bad):
    with pytest.raises(ValueError, match="period"):
        fq.ZeroOrderHold(bad)


def test_matrices_must_agree_in_shape():
    with pytest.raises(ValueError, match=r"A has shape \(2, 3\)"):
        fq.ZeroOrderHold(1).sampled(np.ones((2, 3)), np.ones((2, 1)))
    for A, B in ((np.ones((2, 2, 2)), np.ones((2, 1))), (np.eye(2), np.ones(2)),
                 (np.eye(2), np.ones((3, 1)))):  # fmt: skip
        with pytest.raises(ValueError, match=r"expected \(n, n\) and \(n, inputs\)"):
            fq.ZeroOrderHold(1).sampled(A, B)


def test_an_unknown_hold_is_named(slow, plant):
    with pytest.raises(ValueError, match="hold='soh'"):
        fq.fit(plant, slow, hold="soh")
