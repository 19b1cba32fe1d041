"""Rational functions on DFT lines: polynomials, descent, and the least of several minima."""

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.reading import Reading
from freqid.lti.polynomials import PolynomialBasis as Basis


def on_an_arc():
    return np.exp(1j * np.linspace(0.3, 2.8, 400))


def test_polynomials_are_orthonormal_and_keep_their_recurrence(rng):
    w, weight = on_an_arc(), rng.uniform(0.1, 3, 400)
    basis = Basis.on(w, weight, 12)
    gram = ((basis.Q * weight**2) @ basis.Q.conj().T).real
    assert np.abs(gram - np.eye(13)).max() < 1e-12
    assert np.abs(w * basis.Q[:12] - basis.H.T @ basis.Q).max() < 1e-12 * np.abs(basis.Q).max()
    assert np.abs(basis.at(w[::7]) - basis.Q[:, ::7]).max() < 1e-9 * np.abs(basis.Q).max()


def test_roots_of_a_polynomial_in_the_basis():
    w = on_an_arc()
    wanted = np.sort_complex([0.5, -0.9, 0.3 + 0.8j, 0.3 - 0.8j, 1.1])
    basis = Basis.on(w, np.ones(400), 5)
    values = np.prod(w - wanted[:, None], axis=0)
    # coefficients by projection, and the leading one made 1
    a = (basis.Q.conj() @ values).real
    assert np.allclose(np.sort_complex(basis.roots(a[:5] / a[5])), wanted, atol=1e-12)


def three_modes(seed, n_samples):
    """Modes of 11, 22 and 36 Hz that the output weighs alike, driven by noise."""
    w = 2 * np.pi * np.array([21.67, 36.29, 10.88])
    damping, gain = np.array([0.058, 0.011, 0.0045]), np.array([25.9, 23.1, 15.0])
    A, B = np.zeros((6, 6)), np.zeros((6, 1))
    for i in range(3):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, w[i]], [-w[i], -2 * damping[i] * w[i]]]
        B[2 * i + 1] = gain[i]
    C = np.array([[-2.7, -1.56, -0.29, 0.26, -0.2, -1.1]])
    plant = fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])
    u = np.random.default_rng(seed).standard_normal(n_samples)
    return fq.simulate(plant, u, 0.01)


def brute_force(record, points=60):
    """Least cost of two poles r exp(±jα) and their numerator and transient, over a fine grid."""
    N = len(record.u)
    z = np.exp(2j * np.pi * np.arange(N // 2 + 1) / N)
    U, Y = np.fft.rfft(record.u), np.fft.rfft(record.y)
    weight = np.full(len(z), 2.0)
    weight[[0, -1]] = 1
    weight = np.sqrt(weight / N)
    best = np.inf
    for radius in 1 - np.geomspace(3e-3, 0.3, points):
        for angle in np.linspace(0.02, 3.1, 4 * points):
            a = z**2 - 2 * radius * np.cos(angle) * z + radius**2
            rows = np.array([z * U, U, z * z, z]) / a * weight
            stacked = np.concatenate([rows.real, rows.imag], axis=1).T
            right = np.concatenate([(Y * weight).real, (Y * weight).imag])
            left = np.linalg.lstsq(stacked, right)[1]
            best = min(best, float(left[0]) if len(left) else np.inf)
    return best


@pytest.mark.parametrize(("seed", "n_samples"), [(0, 600), (4, 300), (11, 600)])
def test_a_black_box_of_too_low_an_order_ends_in_the_least_of_its_minima(seed, n_samples):
    """Three modes and two poles: one minimum at each mode; a grid of poles finds the least."""
    record = three_modes(seed, n_samples)
    est = fq.fit(fq.OutputError(2), record)
    assert est.cost <= brute_force(record) * (1 + 1e-9)


@pytest.mark.parametrize("feedthrough", [False, True])
def test_the_start_is_the_minimum_with_a_direct_term_and_without(rng, feedthrough):
    b = [0.4 if feedthrough else 0.0, 0.3, -0.2, 0.1]
    a = np.poly([0.9, 0.7 + 0.5j, 0.7 - 0.5j])
    from scipy.signal import lfilter

    u = rng.standard_normal(2000)
    record = fq.Record(u, lfilter(b, a, u), dt=0.01).with_noise(0.1, seed=1)
    (lines,), plane = lines_in_plane([Reading.of(record)])
    model = first_model([lines], 3, feedthrough)
    est = fq.fit(fq.OutputError(3, feedthrough), record)
    assert est.n_evaluations <= 2
    from freqid.fitting.cost.charts import from_plane

    poles = np.linalg.eigvals(from_plane(model, plane).A)
    assert np.allclose(np.sort_complex(poles), np.sort_complex(est.model.poles), rtol=1e-5)
    assert np.allclose(est.model.numerator(), b, atol=0.02)
    # the time domain: a filter with these coefficients leaves the noise that was put in
    error = lfilter(est.model.numerator(), est.model.denominator(), u) - record.y
    assert error[100:].std() == pytest.approx(0.1, rel=0.05)


def test_very_many_lines_with_gaps_end_in_the_same_minimum(rng):
    """A part of the lines is searched, whatever the period of the weights, and all decide."""
    from scipy.signal import lfilter

    b, a = [0.0, 0.5, -0.2], np.poly([0.6 + 0.6j, 0.6 - 0.6j])
    u = rng.standard_normal(2**17)
    record = fq.Record(u, lfilter(b, a, u), dt=0.01).with_noise(0.5, seed=1)
    weights = np.where(np.arange(2**16 + 1) % 4 == 0, 0.0, 1.0)
    est = fq.fit(fq.OutputError(2), record, weights=weights)
    assert est.n_evaluations <= 3
    # all lines decide: from rest, the estimate's own output is nearer there than the truth's
    ours = lfilter([0, *est.values[:2]], [1, *est.values[2:]], u)
    power = [np.abs(np.fft.rfft(y - record.y)) ** 2 for y in (ours, lfilter(b, a, u))]
    assert weights @ power[0] <= weights @ power[1]
    true = np.array([0.5, -0.2, *a[1:]])
    assert (np.abs(est.values - true) < 5 * np.sqrt(np.diag(est.covariance_matrix))).all()


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_few_lines_are_enough_for_few_poles(rng, order):
    u = rng.standard_normal(2 * order + 2)
    record = fq.Record(u, np.convolve(u, [0, 0.5, 0.2])[: len(u)], dt=0.1).with_noise(0.3, seed=2)
    est = fq.fit(fq.OutputError(order), record, initial_state="steady")
    assert est.cost < np.sum(record.y**2)
