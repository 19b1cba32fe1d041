"""What a skilled user writes in thirty lines: output error in the time domain.

The two-mass plant by zero-order hold, simulated by ``lfilter``, derivatives by finite differences,
Levenberg-Marquardt on parameters scaled to one. And the best start for a black box: Steiglitz and
McBride's iterations, finished by Levenberg-Marquardt on ``lfilter``.
"""

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.signal

GEAR = 1 / 118


def two_mass_filter(theta, dt):
    Jm, k, Ja, fm, d = theta
    r = GEAR
    A = np.array(
        [
            [0, r, -1],
            [-r * k / Jm, -(fm + r**2 * d) / Jm, r * d / Jm],
            [k / Ja, d * r / Ja, -d / Ja],
        ]
    )
    M = np.zeros((4, 4))
    M[:3, :3], M[1, 3] = A * dt, dt / Jm
    E = scipy.linalg.expm(M)
    phi, gamma = E[:3, :3], E[:3, 3]
    a = np.poly(phi).real
    return np.poly(phi - np.outer(gamma, [0, 1, 0])).real - a, a


def grey_box(u, y, dt, start):
    start = np.asarray(start, dtype=float)

    def residual(x):
        b, a = two_mass_filter(x * start, dt)
        return scipy.signal.lfilter(b, a, u) - y

    result = scipy.optimize.least_squares(residual, np.ones(5), method="lm")
    return result.x * start


def output_error(u, y, order=3, iterations=3):
    """Steiglitz-McBride, then Levenberg-Marquardt with analytic filters."""
    n, N = order, len(u)

    def regressors(uf, yf):
        columns = [-yf[n - k : N - k] for k in range(1, n + 1)]
        columns += [uf[n - k : N - k] for k in range(1, n + 1)]
        return np.array(columns).T

    theta = np.linalg.lstsq(regressors(u, y), y[n:], rcond=None)[0]
    for _ in range(iterations):
        a = np.concatenate([[1], theta[:n]])
        roots = np.roots(a)
        roots = np.where(np.abs(roots) > 1, 1 / roots.conj(), roots)
        a = np.real(np.poly(roots))
        uf, yf = scipy.signal.lfilter([1], a, u), scipy.signal.lfilter([1], a, y)
        theta = np.linalg.lstsq(regressors(uf, yf), yf[n:], rcond=None)[0]

    def residual(theta):
        return (
            scipy.signal.lfilter(
                np.concatenate([[0], theta[n:]]), np.concatenate([[1], theta[:n]]), u
            )
            - y
        )

    def jacobian(theta):
        a = np.concatenate([[1], theta[:n]])
        w = scipy.signal.lfilter(np.concatenate([[0], theta[n:]]), a, u)
        wf, uf = scipy.signal.lfilter([1], a, -w), scipy.signal.lfilter([1], a, u)
        J = np.zeros((N, 2 * n))
        for k in range(1, n + 1):
            J[k:, k - 1], J[k:, n + k - 1] = wf[:-k], uf[:-k]
        return J

    return scipy.optimize.least_squares(residual, theta, jac=jacobian, method="lm")
