"""Faults as strong as a test that knows them needs: found in 99 % of runs at a level of 0.1 %.

Such a test knows the fault and the noise's spectrum, but not the parameters. What a fit of those
leaves of the fault, in units of the noise, is the non-centrality of its chi-square.
"""

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.signal
import scipy.stats

import freqid as fq

from .experiments import SLOW, Setting, added, clipped, looped, measured

LEVEL, POWER = 1e-3, 0.99
# the largest size of each that is tried: beyond it the parameters absorb the fault
LARGEST = {
    "delay": 3.0, "feedthrough": 3.0, "offset": 5.0, "drift": 10.0, "spikes": 100.0,
    "saturation": 0.2, "another mode": 3.0, "unlike experiments": 1.0, "unsteady": 1.0,
    "feedback": 3.0,
}  # fmt: skip
# so much less than that is tried: to predictable inputs a loop adds what next to nothing hides
_SMALLEST = 1e-5
# noise of a loop, as a part of the signal, that matters
LEAST_LOOP = 0.1
# future inputs in which a loop is looked for, past ones that are free beside them, runs averaged
_AHEAD, _BEFORE, _RUNS = 6, 12, 8


def needed(degrees, places=1):
    """Non-centrality at which a chi-square test at one of so many places has that power."""
    limit = scipy.stats.chi2.isf(LEVEL / places, degrees)
    return scipy.optimize.brentq(lambda x: scipy.stats.ncx2.sf(limit, degrees, x) - POWER, 1, 300)


def _needed(s, fault):
    """A mode has five unknowns, a spike any place, a change all that the plant has."""
    own = len(s.model.free_parameters)
    places = {"spikes": s.samples, "another mode": s.samples // 2}
    degrees = {"another mode": 5, "unsteady": own, "unlike experiments": own, "feedback": _AHEAD}
    return needed(degrees.get(fault, 1), places.get(fault, 1))


def strength(s, fault):
    """The least size at which a test that knows the fault finds it; None where none is enough."""
    enough = _needed(s, fault)

    def excess(size):
        return np.log(max(_told(s, fault, float(np.exp(size))), 1e-12) / enough)

    low, high = np.log(_SMALLEST * LARGEST[fault]), np.log(LARGEST[fault])
    if excess(high) < 0:
        return None
    if excess(low) > 0:
        return float(np.exp(low))
    return float(np.exp(scipy.optimize.brentq(excess, low, high, xtol=0.03)))


def _told(s, fault, size):
    """The non-centrality of a fault of that size."""
    if fault == "feedback":
        return _told_by_loop(s, size)
    if fault == "saturation":
        return _left(s, clipped(s.clean(), size) - s.clean())
    if fault == "unlike experiments":
        # a common fit takes the mean of both: half of a small difference is left
        return _left(s, (fq.simulate(s.moved(size), s.u(), s.dt).y - s.clean()), of_plant=0.5)
    return _left(s, added(s, fault, size))


def _white(s, rows):
    """Rows (…, N) in units of the noise."""
    white = scipy.signal.lfilter([1, -s.pole], [1], rows)[..., 1:]
    return white / np.sqrt(1 - s.pole**2) * s.ratio / s.clean().std()


def _discrete(s, model):
    return scipy.signal.cont2discrete(model.state_space(), s.dt)


def _free_motions(A, C, samples):
    """What each initial state leaves at the output, (n, samples)."""
    rows = C
    while len(rows) < samples:
        rows, A = np.concatenate([rows, rows @ A]), A @ A
    return rows[:samples].T


def _left(s, fault, of_plant=None):
    """What a fit of parameters and initial states leaves of what is added (N,) to the output."""
    names = [p.name for p in s.model.free_parameters]
    truth = np.array([s.model[n] for n in names])
    u = s.u()
    if of_plant is not None:
        A, _, C, _, _ = _discrete(s, s.model)
        free = _free_motions(A, C, len(u))
        own = scipy.linalg.orth(_white(s, free).T)
        fault = _white(s, fault)
        return of_plant * float(np.sum((fault - own @ (own.T @ fault)) ** 2))
    target = _white(s, s.clean() + fault)

    def residual(x):
        values = dict(zip(names, truth * x[: len(names)], strict=True))
        A, B, C, D, _ = _discrete(s, s.model.with_values(**values))
        b, a = scipy.signal.ss2tf(A, B, C, D)
        y = scipy.signal.lfilter(b[0], a, u) + x[len(names) :] @ _free_motions(A, C, len(u))
        return _white(s, y) - target

    first = np.concatenate([np.ones(len(names)), np.zeros(len(s.model.state_space().A))])
    near = np.where(np.arange(len(first)) < len(names), 10.0, np.inf)
    found = scipy.optimize.least_squares(
        residual, first, bounds=(np.where(near < np.inf, 0, -np.inf), near),
        x_scale="jac", max_nfev=40,
    )  # fmt: skip
    return 2 * float(found.cost)


def _told_by_loop(s, size):
    """How much of the noise inputs still to come tell beside past ones: the mean of some runs."""
    told = []
    for number in range(_RUNS):
        u, _, v = looped(s, s.u(), size, number, late=1)
        e = scipy.signal.lfilter([1, -SLOW], [1], v) / np.sqrt(1 - SLOW**2)
        e, w = e / (size * s.clean().std()), scipy.signal.lfilter([1, -SLOW], [1], u)
        at = np.arange(_BEFORE, len(u) - _AHEAD)
        past, ahead = (
            scipy.linalg.orth(np.array([w[at + k] for k in lags]).T)
            for lags in (range(-_BEFORE, 1), range(1, _AHEAD + 1))
        )
        clear = scipy.linalg.orth(ahead - past @ (past.T @ ahead))
        told.append(float(np.sum((clear.T @ e[at]) ** 2)) - _AHEAD)
    return float(np.mean(told))


def threshold(case):
    """One fault, as strong as a test that knows it needs: what is said, and the verdict."""
    fault = list(LARGEST)[case % len(LARGEST)]
    s = Setting.drawn(case, ("lag",) if fault == "feedback" else ("lag", "mode", "two-mass"))
    size = strength(s, fault)
    if fault == "feedback":
        # a test that knows how a sweep was made sees a loop in it that biases nothing
        size = None if size is None else max(size, LEAST_LOOP)
    kinds, grade = [], "absorbed"
    if size is not None:
        est = fq.fit(s.model, measured(s, fault, size))
        kinds, grade = [w.kind for w in est.warnings], est.verdict.grade
    return {
        "fault": fault, "plant": s.plant, "input": s.input, "pole": s.pole, "size": size,
        "first": kinds[0] if kinds else "none", "named": fault in kinds, "grade": grade,
    }  # fmt: skip


def rows(table):
    """Rows for the printed table."""
    for fault, whole in table.groupby("fault", sort=False):
        part = whole[whole["grade"] != "absorbed"]
        named, right = (100 * x.mean() for x in (part["named"], part["first"] == fault))
        what = f"{fault} at the threshold, {len(part)} runs, {len(whole) - len(part)} absorbed"
        yield f"{what}: named; first", f"{named:.0f}; {right:.0f} %", "95; 80 %"
