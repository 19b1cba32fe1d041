"""The first stage of a search: errors and parameters as logarithms.

The logarithm of the ratio of two responses sees every line alike, and logarithms of the parameters
make gains and frequencies additive, so this stage walks in from far away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from freqid.checks import Array, ComplexArray, FloatArray, IntArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.log_responses import LogResponse
from freqid.fitting.cost.objective import Structure
from freqid.lti import PeriodicHold, Realisation

# lines of the first stage: enough to show every mode, few enough to cost next to nothing
_LINES = 160
# nepers from the start that the first stage may go: a parameter that wants to be zero stops here
_REACH = 16.0


class Logarithms:
    """Unknowns (…, P) by their logarithms beside a start, where that is not zero."""

    def __init__(self, start: FloatArray) -> None:
        self.start, self.log = start, start != 0

    @property
    def begin(self) -> FloatArray:
        """Where the unknowns are those of the start."""
        return np.where(self.log, 0.0, self.start)

    def some(self, which: Array) -> Logarithms:
        """Those of some of many starts."""
        return Logarithms(self.start[which])

    def value(self, xi: FloatArray) -> FloatArray:
        """The unknowns at xi."""
        reach = np.clip(np.where(self.log, xi, 0), -_REACH, _REACH)
        return np.where(self.log, self.start * np.exp(reach), xi)

    def slope(self, xi: FloatArray) -> FloatArray:
        """Derivative of each unknown by its own logarithm."""
        x = self.value(xi)
        return np.where(self.log & (np.abs(xi) < _REACH), x, np.where(self.log, 0.0, 1.0))


def log_bounds(inner: Structure, start: FloatArray) -> FloatArray:
    """Lower and upper bounds (2, P) of logarithms beside a start."""
    log = start != 0
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.array([inner.lower, inner.upper]) / np.where(log, start, 1)
        ends = np.where(log, np.log(np.maximum(ends, 0)), ends)
    ends.sort(axis=0)
    return ends


class LogStructure(Logarithms):
    """A structure with every unknown that is not zero at the start replaced by its logarithm."""

    def __init__(self, inner: Structure, start: FloatArray) -> None:
        super().__init__(start)
        self.inner = inner
        self.lower, self.upper = log_bounds(inner, start)

    def realise(self, xi: FloatArray) -> Realisation:
        """The plant and its derivatives by xi."""
        return self.inner.realise(self.value(xi)).scaled(self.slope(xi))

    def describe(self, xi: FloatArray) -> str:
        """The trial point in the user's words."""
        return self.inner.describe(self.value(xi))


# a response as the data's black box has it, at omega (rad/s), and its relative standard error
Smooth = Callable[[FloatArray], tuple[ComplexArray, FloatArray]]
# relative standard errors up to which lines count alike, and from which they tell nothing
_SURE, _KNOWN = 0.05, 1.0
# neighbours among which the noise of a line is told
_AROUND = 17


def log_targets(
    experiments: Sequence[SpectralExperiment],
    black_boxes: Callable[[int], Smooth] | None,
    count: int = _LINES,
    damping: float = 0.0,
) -> list[LogResponse]:
    """First-stage experiments: what ``black_boxes`` says of each place's response, at about
    ``count`` lines that the input drives.

    With a ``damping`` the responses are those at s = (damping + j) ω, where the resonances of the
    plant and of its model are blunt and find one another from farther away. Without them the
    ratio of output and input is taken where one input frequency rules, as in a response; empty
    where that cannot be read off the data.
    """
    targets = []
    for e in experiments:
        if black_boxes is None:
            response = _empirical(e)
            if response is None or damping:
                return []
            at, G, error = response
            targets.append(LogResponse(at, G, e.hold, _weight(error), e.place))
            continue
        smooth = black_boxes(e.place)
        omega = told(e.lines.omega[e.lines.counted & (e.lines.omega > 0)], smooth, count)
        if len(omega) < 2:
            return []
        at = omega * (1 - 1j * damping) if damping else omega
        G, error = smooth(at)
        targets.append(LogResponse(at, G, e.hold, _weight(error), e.place))
    return targets


def _weight(error: FloatArray) -> FloatArray:
    """What errors of logarithms count where the response has such relative standard errors."""
    return np.where(error < _KNOWN, 1 / np.maximum(error / _SURE, 1), 0)


def told(omega: FloatArray, smooth: Smooth, count: int) -> FloatArray:
    """About so many of the lines at which the response is known: where it turns and bends, half of
    them, and the others evenly, along the frequency and along its logarithm.
    """
    if len(omega) < 2:
        return omega
    even = np.linspace(0, len(omega) - 1, 2 * count)
    ratios = np.searchsorted(omega, np.geomspace(omega[0], omega[-1], 2 * count))
    few = omega[np.unique(np.append(even, np.minimum(ratios, len(omega) - 1)).astype(int))]
    G, error = smooth(few)
    # channels that do not hear one another have nothing to tell
    told_of = (error < _KNOWN) & (G != 0)
    known = told_of.any(axis=(0, 1))
    if known.sum() < 2:
        return few[known]
    few, told_of = few[known], told_of[..., known]
    G = np.where(told_of, G[..., known], 1)
    both = told_of[..., 1:] & told_of[..., :-1]
    bend = (both * np.minimum(np.abs(np.diff(np.log(G), axis=-1)), 1)).mean(axis=(0, 1))
    way = np.concatenate([[0], np.cumsum(bend + bend.mean() + 1e-9)])
    at = np.searchsorted(way, np.linspace(0, way[-1], count))
    return few[np.unique(np.minimum(at, len(few) - 1))]


def _evenly(count: int) -> IntArray:
    """Numbers of so many of ``count`` lines as the first stage takes."""
    return np.unique(np.linspace(0, count - 1, _LINES).astype(int))


def _empirical(e: SpectralExperiment) -> tuple[FloatArray, ComplexArray, FloatArray] | None:
    """Frequencies, Ĝ (outputs, inputs, lines) and its relative standard errors at lines where one
    input frequency rules.
    """
    lines = e.lines
    m, channels, _ = lines.U.shape
    if e.lift > 1 and isinstance(e.hold, PeriodicHold):
        delays = np.exp(-1j * lines.omega[None] * e.hold.period * np.arange(e.lift)[:, None])
        if m != e.lift or channels != 1:
            return None
        U = (lines.U[:, 0] * delays).sum(axis=0) / e.lift
        total = (np.abs(lines.U[:, 0]) ** 2).sum(axis=0) / e.lift
    elif channels == m and m > 1:
        # a frequency response: unit inputs, one at a time
        U, total = np.ones(e.n_lines), np.ones(e.n_lines)
    elif m == 1 and channels == 1:
        every = lines.U[0, 0].reshape(-1, lines.aliases)
        base = int(np.argmin(np.abs(lines.omega_input[0] - lines.omega[0])))
        U, total = every[:, base], (np.abs(every) ** 2).sum(axis=1)
    else:
        return None
    G = lines.Y / np.where(U == 0, 1, U)
    power = np.abs(U) ** 2
    weight = (np.abs(lines.scale) > 0).all(axis=(0, 1))
    usable = (power > 1e-3 * power.max()) & (power > 0.98 * total) & weight & (lines.omega > 0)
    kept = np.flatnonzero(usable)
    if len(kept) < 8:
        return None
    G = G[:, :, kept]
    error = _scatter(G)
    known = (error < _KNOWN).any(axis=(0, 1))
    kept, G, error = kept[known], G[:, :, known], error[:, :, known]
    if len(kept) < 8:
        return None
    few = _evenly(len(kept))
    return lines.omega[kept[few]], G[:, :, few], error[:, :, few]


def _scatter(G: ComplexArray) -> FloatArray:
    """Relative standard errors of responses (…, K): what their lines do not have in common.

    Second differences leave the noise of a smooth response, the median leaves out its resonances.
    """
    ends = [(0, 0)] * (G.ndim - 1) + [(1, 1)]
    bend = np.pad(np.abs(np.diff(G, n=2, axis=-1)) / np.sqrt(6), ends, mode="edge")
    around = (1,) * (G.ndim - 1) + (_AROUND,)
    size = np.abs(G)
    # some lines of noise alone are large; their neighbours are not
    size = np.minimum(size, scipy.ndimage.median_filter(size, around))
    local = scipy.ndimage.median_filter(bend, around) / np.sqrt(np.log(2))
    return np.where(size > 0, local / np.maximum(size, 1e-300), np.inf)
