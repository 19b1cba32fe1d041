"""Sums of two doubles beside mpmath, and what they save: slow motions beside fast ones."""

import mpmath
import numpy as np
import pytest
import scipy.linalg

import freqid as fq
from freqid.lti import StateSpace, basis_of, points
from freqid.lti.double_double import Doubled
from freqid.lti.eigenvectors import eigenvectors, refined
from freqid.lti.exponential import doubled_exponential
from freqid.lti.holds.units import Units
from freqid.lti.responses import transfer


def exactly(M):
    """A sum of two, or a matrix of doubles, in fifty digits."""
    if isinstance(M, Doubled):
        return exactly(M.high) + exactly(M.low)
    return mpmath.matrix(np.atleast_2d(M).tolist())


def apart(ours, exact):
    """The largest difference, as a part of the largest entry."""
    gap = max(abs(x) for x in exactly(ours) - exact)
    return float(gap / max(abs(x) for x in exact))


def drawn(rng, shape, kind):
    high = rng.standard_normal(shape) * 10.0 ** rng.integers(-3, 4, shape)
    if kind is complex:
        high = high + 1j * rng.standard_normal(shape)
    return Doubled(high, 1e-17 * high * rng.uniform(-1, 1, shape))


@pytest.fixture(autouse=True)
def fifty_digits():
    with mpmath.workdps(50):
        yield


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 5, 2), (12, 12, 12), (40, 60, 7)])
def test_sums_products_and_parts_beside_mpmath(kind, shape):
    rng = np.random.default_rng(len(shape) + shape[0])
    n, k, m = shape
    a, b, c = drawn(rng, (n, k), kind), drawn(rng, (k, m), kind), drawn(rng, (n, k), float)
    assert apart(a @ b, exactly(a) * exactly(b)) < 1e-25
    assert apart(a + c, exactly(a) + exactly(c)) < 1e-31
    assert apart(a - c, exactly(a) - exactly(c)) < 1e-31
    assert apart(a / 7, exactly(a) / 7) < 1e-31
    assert apart(Doubled.product(c.high, 0.1), exactly(c.high) * mpmath.mpf(0.1)) == 0


def test_products_of_ill_scaled_rows_keep_their_digits():
    rng = np.random.default_rng(5)
    a = drawn(rng, (6, 6), float)
    a = Doubled(*(M * 10.0 ** np.arange(-90, 90, 30)[:, None] for M in a))
    exact = exactly(a) * exactly(a.high.T.copy())
    ours = a @ Doubled.of(a.high.T.copy())
    for i in range(6):
        for j in range(6):
            size = np.abs(a.high[i]).max() * np.abs(a.high[j]).max()
            assert abs(exactly(ours)[i, j] - exact[i, j]) < 1e-25 * size


def mixed(rates, seed=0):
    """A matrix whose eigenvalues are these, in states that mix them; T, and its inverse."""
    rng = np.random.default_rng(seed)
    n = len(rates)
    T = np.linalg.qr(rng.standard_normal((n, n)))[0] * 10 ** rng.uniform(-0.5, 0.5, n)
    return T @ np.diag(rates) @ np.linalg.inv(T)


@pytest.mark.parametrize("decades", [0, 3, 6, 9])
def test_exponentials_keep_the_slowest_motion(decades):
    X = mixed(-np.array([10.0**decades, 3.0, 0.2, 1e-3]))
    assert apart(doubled_exponential(Doubled.of(X)).high, mpmath.expm(exactly(X))) < 1e-15


@pytest.mark.parametrize("decades", [3, 6, 9])
def test_eigenvalues_beside_mpmath(decades):
    A = mixed(-np.array([10.0**decades, 2.0**decades, 0.7, 0.2, 1e-3]), seed=decades)
    wanted, _ = mpmath.eig(exactly(A))
    wanted = np.sort([float(w.real) for w in wanted])
    plant = StateSpace(A, np.ones((5, 1)), np.ones((1, 5)), np.zeros((1, 1)))
    found, V, inverse = eigenvectors(plant)
    np.testing.assert_allclose(np.sort(found.real), wanted, rtol=1e-14)
    np.testing.assert_allclose((V * found) @ inverse, A, atol=1e-14 * np.abs(A).max())


def test_eigenvalues_that_nearly_agree_are_none_the_worse():
    """Beside vectors this close the product of doubles itself is off by 5e-8, or not, as the
    machine adds: it is multiplied out in fifty digits.
    """
    A = np.diag([-1.0, -1.0 - 1e-12, -1e9])
    A[0, 1] = 1e-3
    values, V = np.linalg.eig(A)
    given = values.astype(complex), V.astype(complex), np.linalg.inv(V).astype(complex)

    def off(values, V, inverse):
        product = exactly(V) * mpmath.diag(values.tolist()) * exactly(inverse)
        return np.array([[float(abs(x)) for x in row] for row in (product - exactly(A)).tolist()])

    found = refined(A, given)
    assert (off(*found) <= off(*given)).all()
    assert (off(*found) <= 1e-9 * np.abs(A) + 1e-12).all()
    np.testing.assert_allclose(np.sort(found[0].real), np.sort(values), rtol=1e-14)


@pytest.mark.parametrize("hold", [fq.ZeroOrderHold(0.3), fq.FirstOrderHold(0.3), fq.BandLimited()])
def test_a_slow_motion_mixed_with_a_fast_one_keeps_its_digits(hold):
    """Sampled matrices and responses of time constants from a microsecond to a thousand seconds."""
    A = mixed(-np.array([1e6, 40.0, 0.5, 1e-3]), seed=3)
    B, C = np.random.default_rng(1).standard_normal((2, 4, 1))
    omega = np.array([1e-3, 0.1, 3.0])
    G = transfer(
        basis_of(StateSpace(A, B, C.T, np.zeros((1, 1)))).through(hold), points(omega, hold)
    )
    n = mpmath.eye(4)
    if isinstance(hold, fq.BandLimited):
        places, phi, gamma, following = [mpmath.mpc(0, w) for w in omega], exactly(A), exactly(B), 0
    else:
        h = mpmath.mpf(hold.period)
        X = mpmath.zeros(6)
        X[:4, :4], X[:4, 4], X[4, 5] = exactly(A) * h, exactly(B) * h, 1
        E = mpmath.expm(X)
        ramp = E[:4, 5] if hold.reaches_next else 0 * E[:4, 5]
        phi, gamma, following = E[:4, :4], E[:4, 4] - ramp, ramp
        for ours, exact in zip(hold.sampled(A, B), (phi, gamma, following), strict=True):
            assert not np.any(ours) or apart(ours, exact) < 1e-14
        places = [mpmath.exp(mpmath.mpc(0, w) * h) for w in omega]
    for k, z in enumerate(places):
        exact = exactly(C.T) * mpmath.lu_solve(z * n - phi, gamma + z * following)
        assert abs(mpmath.mpc(G[0, 0, k]) - exact[0]) < 1e-12 * abs(exact[0])


def test_derivatives_of_a_plant_that_has_no_eigenvectors_keep_their_digits():
    """Two integrators beside a fast lag: the exponential of the block matrix, by differences."""
    rng = np.random.default_rng(2)
    core = np.zeros((4, 4))
    core[0, 1], core[2, 2], core[3, 3] = 1.0, -1e6, -0.3
    T = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    A, B = T @ core @ T.T, rng.standard_normal((4, 1))
    dA, dB = A * rng.standard_normal(A.shape), B * 0.0
    hold, step = fq.ZeroOrderHold(0.1), mpmath.mpf("1e-20")
    _, change = hold.sampled_derivatives(A, B, dA[None], dB[None])

    def phi(sign):
        return mpmath.expm((exactly(A) + sign * step * exactly(dA)) * mpmath.mpf(0.1))

    assert apart(change.phi[0], (phi(1) - phi(-1)) / (2 * step)) < 1e-13


@pytest.mark.parametrize("rate", [1e-3, 0.5])
def test_long_chains_that_a_balance_grades_keep_their_digits(rate):
    """Ten lags in a row of nearly one rate, over many samples: entries reach 1e7."""
    rng = np.random.default_rng(0)
    A = np.diag(-rate * (1 + 1e-3 * rng.standard_normal(10))) + np.diag(np.ones(9), 1)
    B, h = rng.standard_normal((10, 2)), 25.0
    X = mpmath.zeros(12)
    X[:10, :10], X[:10, 10:] = exactly(A) * h, exactly(B) * h
    exact = mpmath.expm(X)
    ours = fq.ZeroOrderHold(h).sampled(A, B)
    assert apart(ours.phi, exact[:10, :10]) < 1e-14
    assert apart(ours.gamma, exact[:10, 10:]) < 1e-14


@pytest.mark.parametrize("kind", [float, complex])
def test_many_at_once_are_what_each_is(kind):
    rng = np.random.default_rng(8)
    many = drawn(rng, (4, 5, 5), kind)
    many = Doubled(*(M / np.abs(many.high).max() * 40 for M in many))
    both, grown = many @ many, doubled_exponential(many)
    for i in range(4):
        one = Doubled(*(M[i] for M in many))
        assert apart(Doubled(*(M[i] for M in both)), exactly(one) * exactly(one)) < 1e-25
        wanted = mpmath.expm(exactly(one))
        assert apart(Doubled(*(M[i] for M in grown)), wanted) < 1e-20


def test_the_slowest_rate_is_known_to_its_own_last_digits():
    """Of two rates seven decades apart no other is near, and it is their own size that counts."""
    rng = np.random.default_rng(4)
    V = rng.standard_normal((2, 2))
    A = V @ np.diag([-1e-7, -1.0]) @ np.linalg.inv(V)
    eigen = eigenvectors(StateSpace(A, np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1))))
    exact = sorted(mpmath.eig(exactly(A), right=False, left=False), key=abs)
    found = sorted(eigen[0], key=abs)
    for ours, theirs in zip(found, exact, strict=True):
        assert abs(mpmath.mpc(ours) / theirs - 1) < 1e-13


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 0.1, 1.0, 1e9])
@pytest.mark.parametrize("hold", [fq.ZeroOrderHold, fq.FirstOrderHold])
def test_digits_do_not_depend_on_the_unit_of_time(hold, scale):
    """Rates nine decades apart: what is fast is so beside the period, whatever the seconds are."""
    V = np.array([[1.0, 0.4], [0.3, 1.0]])
    A = V @ np.diag([-1e-6, -1e3]) @ np.linalg.inv(V)
    B, dA = np.array([[1.0], [2.0]]), np.array([[[0.0, 1.0], [0.5, 0.0]]])
    h, dB = 1.0, np.zeros((1, 2, 1))
    found, slope = hold(h / scale).sampled_derivatives(A * scale, B * scale, dA * scale, dB)
    phi = mpmath.expm(exactly(A) * h)
    step = mpmath.mpf(10) ** -20
    moved = (mpmath.expm(exactly(A) + step * exactly(dA[0])) - phi) / step
    assert apart(found.phi, phi) < 1e-13
    assert apart(slope.phi[0], moved) < 1e-12
    same = hold(h / scale).sampled(A * scale, B * scale)
    for ours, theirs in zip(found, same, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14 * np.abs(theirs).max())


def test_states_in_units_far_apart_keep_their_digits():
    """Balanced, an entry may be next to nothing that is the largest in the user's units."""
    rng, hidden = np.random.default_rng(0), 0
    for _ in range(400):
        n = int(rng.integers(2, 6))
        V = rng.standard_normal((n, n))
        A = V @ np.diag(-(10 ** rng.uniform(-1, 1.3, n))) @ np.linalg.inv(V)
        units = 10.0 ** rng.integers(-9, 9, n)
        A = A * units / units[:, None]
        if rng.random() < 0.5:
            A *= rng.random((n, n)) < 0.7
        B, h = rng.standard_normal((n, 1)), 0.3
        within = Units.of(A, B, h)
        if not within.hide(scipy.linalg.expm(within.into(A, B)[0] * h)):
            continue
        hidden += 1
        found = fq.ZeroOrderHold(h).sampled(A, B)
        assert apart(found.phi, mpmath.expm(exactly(A) * mpmath.mpf(h))) < 1e-14
    assert hidden
