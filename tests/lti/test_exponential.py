"""Matrix exponentials against fifty digits where eigenvalues nearly agree; what rounding costs."""

import mpmath
import numpy as np
import pytest
import scipy.linalg

import freqid as fq
from freqid.lti import StateSpace, basis_of, exponential, rounding, transfer


def error(ours, X):
    with mpmath.workdps(50):
        exact = np.array(mpmath.expm(mpmath.matrix(X.tolist())).tolist(), dtype=float)
    return np.abs(ours - exact).max() / np.abs(exact).max()


@pytest.mark.parametrize("apart", [0.0, 2e-16, 1e-13, 1e-10, 1e-7, 1e-4, 1e-2, 0.3, 2.0])
@pytest.mark.parametrize("turned", [False, True])
def test_lags_in_a_row_whose_rates_nearly_agree(apart, turned):
    n = 5
    X = np.diag(-3.0 * (1 + apart * np.arange(n))) + 4 * np.diag(np.ones(n - 1), 1)
    X = X.T.copy() if turned else X
    assert error(exponential(X), X) < 3e-15
    stack = np.stack([X, 0.5 * X, -0.1 * X])
    for ours, one in zip(exponential(stack), stack, strict=True):
        assert error(ours, one) < 1e-13


def test_what_scipy_makes_of_them_is_why():
    """Should this fail one day, scipy's own serves again."""
    X = np.diag([-30.0, -30.0 * (1 + 1e-13)]) + 40 * np.diag([1.0], 1)
    assert error(scipy.linalg.expm(X), X) > 1e-5


def test_fast_and_slow_lags_keep_their_digits():
    X = np.array([[-1e6, 1e6, 0.0], [0, -1e6 * (1 + 1e-12), 1.0], [0, 0, -1e-3]])
    assert error(exponential(X), X) < 1e-13


@pytest.mark.parametrize("turned", [False, True])
def test_a_chain_of_equal_lags_and_its_derivative_keep_their_digits(turned):
    """scipy's own leaves 1.5e-12 of them: the input's integrator stands beside the lags."""
    rng, n, h = np.random.default_rng(2), 8, 36.0
    A = np.diag(np.full(n, -0.053)) + np.diag(np.ones(n - 1), 1)
    A, B = A.T.copy() if turned else A, rng.standard_normal((n, 2))
    dA = A * rng.standard_normal(A.shape)
    _, change = fq.ZeroOrderHold(h).sampled_derivatives(A, B, dA[None], 0 * B[None])
    step = 1e-20
    with mpmath.workdps(50):
        own, along = mpmath.matrix(A.tolist()) * h, mpmath.matrix(dA.tolist()) * (h * step)
        slope = (mpmath.expm(own + along) - mpmath.expm(own - along)) / (2 * mpmath.mpf(step))
        exact = np.array(slope.tolist(), float)
    assert np.abs(change.phi[0] - exact).max() < 1e-14 * np.abs(exact).max()


def test_nearly_equal_rates_keep_the_digits_of_a_response():
    """A condition of the eigenvectors of 3e4 alone would cost more than four of them."""
    a, b = 1.5, 1.5 * (1 + 3e-5)
    plant = StateSpace(
        np.array([[-a, 1.0], [0.0, -b]]), np.array([[0.3], [1.0]]), np.array([[1.0, 2e-4]]),
        np.zeros((1, 1)),
    )  # fmt: skip
    omega = np.linspace(0.1, 50, 40)
    G = transfer(basis_of(plant).through(fq.BandLimited()), 1j * omega)[0, 0]
    s = 1j * omega
    exact = (0.3 + 1.0 / (s + b)) / (s + a) + 2e-4 / (s + b)
    np.testing.assert_allclose(G, exact, rtol=1e-14)


@pytest.mark.parametrize("hold", [fq.ZeroOrderHold(0.5), fq.FirstOrderHold(0.5)])
def test_two_equal_lags_are_simulated_and_fitted_as_they_are(hold):
    def matrices(a, b):
        return [[-a, 1.0], [0.0, -b]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]

    model = fq.GreyBox(matrices, [fq.Parameter("a", 5.0), fq.Parameter("b", 5.0)])
    near = model.with_values(b=5.0 * (1 + 1e-12))
    u = fq.white_noise(200, seed=1)
    one, other = (fq.simulate(m, u, 0.5, hold=hold).y for m in (model, near))
    assert np.abs(one - other).max() < 1e-10 * np.abs(one).max()
    w = np.linspace(0.1, 6, 50)
    G, H = (m.frequency_response(w, hold).response for m in (model, near))
    assert np.abs(G - H).max() < 1e-10 * np.abs(G).max()


def mixed(fast):
    """A slow lag and a fast one whose states were turned into one another."""
    T = np.array([[1.0, 0.4], [-0.6, 0.8]])
    A = T @ np.diag([-1e-3, -fast]) @ np.linalg.inv(T)
    return StateSpace(A, np.array([[1.0], [0.5]]), np.array([[1.0, 0.3]]), np.zeros((1, 1)))


def test_rounding_is_told_where_states_mix_fast_and_slow():
    hold, omega = fq.ZeroOrderHold(10.0), np.array([1e-3, 1e-2])
    assert rounding(mixed(1.0), hold, omega) < 1e-11
    assert rounding(mixed(1e7), hold, omega) > 1e-7
    plain = fq.GreyBox(lambda g: mixed(1e7), [fq.Parameter("g", 1.0)])
    with pytest.warns(RuntimeWarning, match="rounding: .* rad/s"):
        plain.frequency_response(omega, hold)
    with pytest.warns(RuntimeWarning, match="rounding"):
        fq.simulate(plain, np.ones(10), 10.0)


def test_springs_between_masses_are_no_rounding():
    """A rigid body's rate of zero is a difference of large entries, which are of one spring."""
    hold, omega = fq.ZeroOrderHold(1e-3), np.array([1e-3, 1.0, 1e3])
    assert rounding(fq.two_mass().state_space(), hold, omega) < 1e-11
    assert rounding(fq.drivetrain(5).state_space(), hold, omega) < 1e-11


def test_a_fit_says_what_rounding_leaves():
    def matrices(a):
        return mixed(1e10 * a)

    model = fq.GreyBox(matrices, [fq.Parameter("a", 1.0)])
    u = fq.white_noise(300, seed=2)
    y = fq.white_noise(300, seed=3)
    est = fq.fit(model, fq.Record(u, y, 10.0), n_starts=1)
    found = [w for w in est.warnings if w.kind == "rounding"]
    assert found
    assert found[0].severity == "minor"
    assert found[0].number > 1e-6


def test_equal_lags_that_were_mixed_are_told():
    """Rounding pulls their rates apart, by the sixth root of a last digit."""
    rng, n = np.random.default_rng(4), 6
    A = -11 * np.eye(n) + np.diag(np.full(n - 1, 1000.0), 1)
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    A, B, C = Q @ A @ Q.T, rng.standard_normal((n, 1)), rng.standard_normal((1, n))
    model = fq.GreyBox(lambda k: (A * k, B, C, None), [fq.Parameter("k", 1.0)])
    with pytest.warns(RuntimeWarning, match="rounding: the model's matrices"):
        fq.simulate(model, np.ones(200), 0.02)


def test_a_zero_on_a_line_is_no_loss():
    body = StateSpace(
        np.array([[0.0, 1.0], [0.0, -5e-10]]), np.array([[0.0], [0.5]]), np.array([[1.0, 0.0]]),
        np.zeros((1, 1)),
    )  # fmt: skip
    assert rounding(body, fq.ZeroOrderHold(0.01), np.pi / 0.01 * np.array([0.1, 0.3, 1.0])) < 1e-9


def test_a_line_far_below_the_largest_response_is_told_too():
    """A free body is loud at the first line, and what is delicate all that is left at the other."""
    plant, none = mixed(1e9), np.zeros((2, 2))
    both = StateSpace(
        np.block([[np.array([[0.0, 1.0], [0.0, 0.0]]), none], [none, plant.A]]),
        np.vstack([[[0.0], [1e-2]], plant.B]), np.hstack([[[1.0, 0.0]], plant.C]), plant.D,
    )  # fmt: skip
    near, far = np.array([1e-6]), np.array([1e2])
    told = rounding(both, fq.BandLimited(), far)
    assert told > 100 * rounding(both, fq.BandLimited(), near)
    assert rounding(both, fq.BandLimited(), np.concatenate([near, far])) > 0.5 * told


@pytest.mark.parametrize("size", [1e200, 1e308])
def test_what_is_beyond_numbers_is_no_error(size):
    for X in (np.full((2, 2), size), np.array([[size, size], [0.0, 0.5 * size]])):
        assert not np.isfinite(exponential(X)).all()
