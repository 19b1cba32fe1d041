"""The first stage of a search: errors and parameters as logarithms.

Least squares on the response itself is lost once a resonance of the model has moved past that of
the data. The logarithm of the ratio sees magnitude and phase of every line alike, and logarithms
of the parameters make gains and frequencies additive, so this stage walks in from far away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Structure
from freqid.lti import Hold, PeriodicHold, Realisation, sampled_response

# lines of the first stage: enough to show every mode, few enough to cost next to nothing
_LINES = 160
# nepers from the start that the first stage may go: a parameter that wants to be zero stops here
_REACH = 16.0


class LogResponse:
    """log(G/Ĝ) on a few lines of an experiment: the residual of the first stage.

    ``weight`` (outputs, inputs, lines) says how well Ĝ is known.
    """

    def __init__(
        self,
        omega: FloatArray,
        response: ComplexArray,
        hold: Hold,
        weight: FloatArray | float = 1.0,
    ) -> None:
        self.omega, self.measured, self.hold = omega, response, hold
        self.weight = np.broadcast_to(weight, response.shape)
        self.n_rows = 2 * response.size

    @property
    def energy(self) -> float:
        """Errors of one neper and one radian at every line."""
        return float(self.n_rows)

    def at(self, realisation: Realisation) -> _LogEvaluation:
        """Evaluate at one trial point."""
        return _LogEvaluation(self, realisation)


class _LogEvaluation:
    def __init__(self, target: LogResponse, realisation: Realisation) -> None:
        G, self.dG = sampled_response(realisation, target.omega, target.hold)
        self.G, self.weight = G, target.weight
        ratio = G / target.measured
        error = np.log(np.abs(ratio)) + 1j * np.angle(ratio)
        self.residual = (error * target.weight).reshape(-1).view(float)
        self.transient: FloatArray | None = None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        relative = self.dG / self.G * self.weight
        return relative.reshape(len(relative), -1).view(float)


class LogStructure:
    """A structure with every unknown that is not zero at the start replaced by its logarithm."""

    def __init__(self, inner: Structure, start: FloatArray) -> None:
        self.inner, self.start = inner, start
        self.log = start != 0
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.array([inner.lower, inner.upper]) / np.where(self.log, start, 1)
            ends = np.where(self.log, np.log(np.maximum(ends, 0)), ends)
        ends.sort(axis=0)
        self.lower, self.upper = ends

    def value(self, xi: FloatArray) -> FloatArray:
        """The inner unknowns at xi."""
        reach = np.clip(np.where(self.log, xi, 0), -_REACH, _REACH)
        return np.where(self.log, self.start * np.exp(reach), xi)

    def realise(self, xi: FloatArray) -> Realisation:
        """The plant and its derivatives by xi."""
        x = self.value(xi)
        realisation = self.inner.realise(x)
        by = np.where(self.log & (np.abs(xi) < _REACH), x, np.where(self.log, 0.0, 1.0))
        return realisation.scaled(by)

    def describe(self, xi: FloatArray) -> str:
        """The trial point in the user's words."""
        return self.inner.describe(self.value(xi))


# a response as the data's black box has it, at omega (rad/s), and its relative standard error
Smooth = Callable[[FloatArray], tuple[ComplexArray, FloatArray]]
# relative standard errors up to which lines count alike
_SURE = 0.05


def log_targets(
    experiments: Sequence[SpectralExperiment], smooth: Smooth | None
) -> list[LogResponse]:
    """First-stage experiments: ``smooth`` at lines that the input drives.

    Without it the ratio of output and input is taken where one input frequency rules, as in a
    response; empty where that cannot be read off the data.
    """
    targets = []
    for e in experiments:
        if smooth is None:
            response = _empirical(e)
            if response is None:
                return []
            targets.append(LogResponse(*response, e.hold))
            continue
        power = (np.abs(e.lines.U) ** 2).sum(axis=(0, 1)).reshape(-1, e.lines.aliases).max(axis=1)
        driven = e.lines.counted & (power > 1e-3 * power.max()) & (e.lines.omega > 0)
        omega = e.lines.omega[_evenly(np.flatnonzero(driven))]
        G, error = smooth(omega)
        targets.append(LogResponse(omega, G, e.hold, 1 / np.maximum(error / _SURE, 1)))
    return targets


def _evenly(lines: IntArray) -> IntArray:
    """So many of them as the first stage takes."""
    return lines[np.unique(np.linspace(0, len(lines) - 1, _LINES).astype(int))]


def _empirical(e: SpectralExperiment) -> tuple[FloatArray, ComplexArray] | None:
    """Frequencies and Ĝ (outputs, inputs, lines) at lines where one input frequency rules."""
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
    usable &= (np.abs(G) > 0).all(axis=(0, 1))
    kept = np.flatnonzero(usable)
    if len(kept) < 8:
        return None
    kept = _evenly(kept)
    return lines.omega[kept], G[:, :, kept]
