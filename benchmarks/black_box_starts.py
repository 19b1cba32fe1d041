"""Which start without iteration serves black boxes best: a comparison on hard cases.

    python benchmarks/black_box_starts.py      about a minute

Each method gives poles; zeros, transients and direct terms follow from linear least squares, and
the same descent follows. ``error`` is the cost of the start over the best cost of all, less one;
``end`` the same after the descent, with the evaluations it took. Subspace: freqid's own (McKelvey,
Akçay and Ljung 1996). SK: twenty Sanathanan-Koerner iterations with a transient polynomial, in
polynomials made orthogonal on the lines (Stieltjes' procedure). AAA: scipy.interpolate.AAA of the
empirical response, which has no place for a transient. Both: what freqid does, subspace poles
refined by a few Sanathanan-Koerner and then Gauss-Newton steps in orthonormal polynomials.
"""

import numpy as np
import scipy.interpolate
import scipy.linalg

import freqid as fq
from freqid.fitting.black_box.held_inputs import inputs_of
from freqid.fitting.black_box.output_error import _descend
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.black_box.subspace import identify
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.reading import Reading
from freqid.lti.state_space import StateSpace


def modes(frequencies, dampings):
    """A chain of modes in parallel, unit static gain each."""
    n = len(frequencies)
    A, B, C = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 1)), np.zeros((1, 2 * n))
    for i, (f, z) in enumerate(zip(frequencies, dampings, strict=True)):
        w = 2 * np.pi * f
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, w], [-w, -2 * z * w]]
        B[2 * i + 1], C[0, 2 * i] = w, 1
    return fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])


def noisy(plant, u, dt, level, **options):
    record = fq.simulate(plant, u, dt, **options)
    return record.with_noise(level * record.y.std(), seed=3)


def cases():
    dt = 0.5e-3
    paper = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 10, dt), dt)
    noise = np.random.default_rng(0).standard_normal
    four = modes([3, 7, 13, 21], [0.005] * 4)
    near = modes([10, 10.4, 11], [0.004] * 3)
    twelve = modes([3, 7, 13, 21, 1.6, 9.5], [0.01, 0.01, 0.01, 0.01, 0.6, 0.6])
    tail = np.zeros(8)
    tail[::2] = 3.0
    short = noisy(four, noise(600), 0.01, 0.01, initial_state=tail)
    return {
        "paper, full rate": (paper, 3, None, (10, 80)),
        "paper, decimated, ZOH": (paper.decimate(10), 3, "zoh", None),
        "paper, 20 % noise": (paper.with_noise(0.2 * paper.y.std()), 3, None, (10, 80)),
        "four modes, damping 0.005, chirp": (
            noisy(four, fq.chirp(1, 30, 40, 0.01), 0.01, 0.01), 8, None, (1, 30)),
        "the same, short, large transient": (short, 8, None, None),
        "three modes within 10 %, 5 % noise": (noisy(near, noise(8000), 0.01, 0.05), 6, None, None),
        "order 12, 1 % noise": (noisy(twelve, noise(20000), 0.01, 0.01), 12, None, None),
        "order 12, 30 % noise": (noisy(twelve, noise(20000), 0.01, 0.3), 12, None, None),
        "four modes sampled 50 times too fast": (
            noisy(four, noise(60000).cumsum() * 0.02, 5e-4, 0.01), 8, None, (0.5, 40)),
    }  # fmt: skip


def from_poles(poles, experiment, feedthrough):
    """A real state space with these poles, completed to conjugate pairs, fitted to the lines."""
    blocks, rows = [], []
    for pole in poles:
        if abs(pole.imag) > 1e-9 * abs(pole):
            if pole.imag > 0:
                blocks.append([[pole.real, pole.imag], [-pole.imag, pole.real]])
                rows += [1.0, 0.0]
        else:
            blocks.append([[pole.real]])
            rows.append(1.0)
    A = scipy.linalg.block_diag(*blocks)
    return inputs_of([experiment], A, np.array([rows]), feedthrough)


def orthogonal(w, weight, degree):
    """Polynomials of w orthonormal on the lines with real coefficients, and their recurrence."""
    Q = np.empty((len(w), degree + 1), complex)
    H = np.zeros((degree + 1, degree))

    def dot(a, b):
        return float(np.real(np.vdot(a * weight, b * weight)))

    Q[:, 0] = 1 / np.sqrt(dot(np.ones(len(w)), np.ones(len(w))))
    for j in range(degree):
        v = w * Q[:, j]
        for _ in range(2):
            for i in range(j + 1):
                h = dot(Q[:, i], v)
                H[i, j] += h
                v = v - h * Q[:, i]
        H[j + 1, j] = np.sqrt(dot(v, v))
        Q[:, j + 1] = v / H[j + 1, j]
    return Q, H


def sanathanan_koerner(experiment, order, feedthrough):
    lines = experiment.lines
    w, U, Y = experiment.points.z, lines.U[0, 0], lines.Y[0, 0]
    previous = np.ones(len(w), complex)
    for _ in range(20):
        weight = np.abs(U) / np.abs(previous)
        Q, H = orthogonal(w, weight, order)
        top = order + 1
        free = Q * lines.scale[0, 0][:, None]
        columns = np.hstack([Q[:, :top] * U[:, None], free[:, :top], -Q[:, :order] * Y[:, None]])
        columns, right = columns / previous[:, None], Y * Q[:, order] / previous
        stacked = np.concatenate([columns.real, columns.imag])
        solution = np.linalg.lstsq(stacked, np.concatenate([right.real, right.imag]))[0]
        a = np.append(solution[-order:], 1.0)
        previous = Q @ a
    # roots of Σ a_i q_i by the comrade matrix of the recurrence
    comrade = H[:order, :order].copy()
    comrade[:, -1] -= H[order, order - 1] * a[:order] / a[order]
    return from_poles(np.linalg.eigvals(comrade), experiment, feedthrough)


def aaa(experiment, order, feedthrough):
    w, G = experiment.points.z, experiment.lines.Y[0, 0] / experiment.lines.U[0, 0]
    # both halves of the circle, so that the poles come in pairs
    r = scipy.interpolate.AAA(
        np.concatenate([w, w.conj()]), np.concatenate([G, G.conj()]), max_terms=order + 1,
        clean_up=False,
    )  # fmt: skip
    poles = r.poles()
    pairs = poles[poles.imag > 1e-9 * np.abs(poles)]
    real = poles[np.abs(poles.imag) <= 1e-9 * np.abs(poles)].real
    poles = np.concatenate([pairs, pairs.conj(), real])
    while len(poles) < order:
        poles = np.append(poles, 0.0)
    return from_poles(poles[-order:] if len(poles) > order else poles, experiment, feedthrough)


METHODS = {
    "subspace": lambda e, n, d: identify([e], n, d),
    "SK": sanathanan_koerner,
    "AAA": aaa,
    "both": lambda e, n, d: first_model([e], n, d),
}


def compare(record, order, hold, band):
    reading = Reading.of(record, hold, band)
    (experiment,), plane = lines_in_plane([reading])
    found = {}
    for name, method in METHODS.items():
        try:
            first: StateSpace = method(experiment, order, False)
            chart = Chart(first, False, plane, reading.sample_time)
            at = Objective(chart, [experiment]).point(np.zeros(chart.size))
            _, solution, objective = _descend(chart, [experiment])
            found[name] = at.cost, solution.point.cost, objective.n_evaluations
        except (ValueError, AssertionError, AttributeError, np.linalg.LinAlgError) as error:
            found[name] = np.inf, np.inf, 0
            print(f"  {name}: {type(error).__name__}: {error}")
    energy = 1e-18 * experiment.energy
    best = max(min(end for _, end, _ in found.values()), energy)
    return {
        name: (max(start, energy) / best - 1, max(end, energy) / best - 1, count)
        for name, (start, end, count) in found.items()
    }


def main():
    head = "".join(f"{m + ': error, end, evaluations':>34s}" for m in METHODS)
    print(f"{'case':38s}{head}")
    for name, case in cases().items():
        result = compare(*case)
        cells = "".join(f"{s:14.1e}{e:12.1e}{n:8d}" for s, e, n in result.values())
        print(f"{name:38s}{cells}", flush=True)


if __name__ == "__main__":
    main()
