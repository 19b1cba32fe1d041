"""Where an input's energy lies: densities and lines, before and after decimation.

A spectrum belongs to the sequence that a converter holds. It may have a density, one-sided in
u²/Hz from zero to the Nyquist limit, and lines, each with a power in u². The power of all of it is
the mean square of the sequence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, choice, numbers, positive, whole
from freqid.data import Band, merged_lines, unfold
from freqid.excitation.filters import Filter, known_filter, power_gain
from freqid.lti import panel_nodes, resolved

if TYPE_CHECKING:
    import pandas as pd


class InputSpectrum:
    """Base of the spectra; they can be added to one another and multiplied by a number."""

    def density(self, frequency: ArrayLike, dt: float) -> FloatArray:
        """One-sided density in u²/Hz at ``frequency`` (Hz) of the sequence at ``dt`` (s)."""
        return np.zeros(np.shape(frequency))

    def lines(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u² of the lines of the sequence sampled at ``dt`` (s)."""
        return np.zeros(0), np.zeros(0)

    def edges(self, dt: float) -> FloatArray:
        """Frequencies in Hz between which the density is smooth; empty where there is none."""
        return np.zeros(0)

    def aliased_density(self, frequency: ArrayLike, dt: float, factor: int = 1) -> FloatArray:
        """Density in u²/Hz after every ``factor``-th sample has been kept: the sum of its folds.

        >>> round(float(WhiteSpectrum().aliased_density([10.0], dt=0.5e-3, factor=10)[0]), 9)
        0.01
        """
        folds = np.abs(unfold(frequency, dt, factor))
        return np.asarray(self.density(folds, dt)).sum(axis=-1)

    def aliased_lines(self, dt: float, factor: int = 1) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u² of the lines after decimation.

        Lines that fold onto one another add their powers, as those of unrelated phase do.

        >>> f, power = LineSpectrum([30, 70], [1.0, 2.0]).aliased_lines(dt=0.01, factor=1)
        Traceback (most recent call last):
        ...
        freqid.checks.InputError: spectrum has energy at 70 Hz, above 50 Hz, ...
        """
        f, power = self.lines(dt)
        at, _, groups = merged_lines(f, dt, factor)
        return at, np.bincount(groups, weights=power, minlength=len(at))

    def power(self, dt: float) -> float:
        """Mean square of the sequence in u²."""
        total = float(self.lines(dt)[1].sum())
        edges = self.edges(dt)
        if len(edges):
            panels = np.column_stack([edges[:-1], edges[1:]])
            panels = resolved(panels, lambda f: self.density(f, dt)[None])
            f, weights = panel_nodes(panels)
            total += float(weights @ self.density(f, dt))
        return total

    def to_frame(self, dt: float, factor: int = 1, points: int = 401) -> pd.DataFrame:
        """Density and lines on the way to a file: frequency / Hz, density / (u²/Hz), power / u²."""
        import pandas as pd

        top = 0.5 / (positive("dt", dt, "s") * whole("factor", factor))
        f = np.linspace(0, top, whole("points", points, least=2, most=10_000_000))
        at, power = self.aliased_lines(dt, factor)
        frames = [pd.DataFrame({"frequency": at, "power": power})]
        if len(self.edges(dt)):
            density = self.aliased_density(f, dt, factor)
            frames.insert(0, pd.DataFrame({"frequency": f, "density": density}))
        return pd.concat(frames, ignore_index=True)

    def __add__(self, other: object) -> InputSpectrum:
        if not isinstance(other, InputSpectrum):
            return NotImplemented
        return SumSpectrum((self, other))

    def __mul__(self, factor: float) -> InputSpectrum:
        return ScaledSpectrum(self, factor)

    __rmul__ = __mul__


@dataclass(frozen=True)
class ChirpSpectrum(InputSpectrum):
    """A chirp from ``low`` to ``high`` (Hz): flat between them, or as 1/f for ``method="log"``.

    The ripple of a finite sweep is left out. Power: ``amplitude``²/2. Raises ValueError unless
    0 < low < high.

    >>> round(float(ChirpSpectrum(10, 80).power(0.5e-3)), 12)
    0.5
    """

    low: float
    high: float
    method: Literal["linear", "log"] = "linear"
    amplitude: float = 1.0

    def __post_init__(self) -> None:
        if positive("low", self.low, "Hz") >= positive("high", self.high, "Hz"):
            raise InputError(f"low={self.low:g} Hz must be below high={self.high:g} Hz")
        choice("method", self.method, ("linear", "log"))
        positive("amplitude", self.amplitude)

    def density(self, frequency: ArrayLike, dt: float) -> FloatArray:
        """One-sided density in u²/Hz at ``frequency`` (Hz)."""
        below_nyquist(self.high, dt)
        f = np.asarray(frequency, dtype=float)
        # one-sided: a band masks frequencies of either sign
        inside = Band(self.low, self.high).inside(f) & (f > 0)
        power = self.amplitude**2 / 2
        if self.method == "linear":
            return np.where(inside, power / (self.high - self.low), 0.0)
        return np.where(inside, power / np.log(self.high / self.low) / np.where(inside, f, 1), 0)

    def edges(self, dt: float) -> FloatArray:
        """The ends of the sweep in Hz."""
        below_nyquist(self.high, dt)
        return np.array([self.low, self.high], dtype=float)


@dataclass(frozen=True)
class WhiteSpectrum(InputSpectrum):
    """White noise of variance ``power`` (u²): flat from zero to the Nyquist limit."""

    variance: float = 1.0

    def __post_init__(self) -> None:
        positive("variance", self.variance)

    def density(self, frequency: ArrayLike, dt: float) -> FloatArray:
        """One-sided density in u²/Hz at ``frequency`` (Hz)."""
        return np.full(np.shape(frequency), 2 * dt * self.variance)

    def edges(self, dt: float) -> FloatArray:
        """Zero and the Nyquist limit in Hz."""
        return np.array([0.0, 0.5 / dt])


@dataclass(frozen=True)
class LineSpectrum(InputSpectrum):
    """Sinusoids at ``frequencies`` (Hz) of mean squares ``powers`` (u²).

    Raises ValueError for an empty list, negative or repeated frequencies, a power that is negative
    or not finite, or no power at all.

    >>> LineSpectrum([5, 10], [0.5, 0.5]).power(1e-3)
    1.0
    """

    frequencies: Sequence[float]
    powers: Sequence[float]

    def __post_init__(self) -> None:
        f, power = numbers("frequencies", self.frequencies), numbers("powers", self.powers)
        if f.ndim != 1 or f.shape != power.shape or len(f) == 0:
            raise InputError(
                f"frequencies has shape {f.shape} and powers {power.shape}; expected as many "
                "powers as frequencies, at least one"
            )
        if not np.isfinite(f).all() or (f < 0).any() or len(np.unique(f)) < len(f):
            raise InputError("frequencies must be finite, not negative and all different (Hz)")
        if not np.isfinite(power).all() or (power < 0).any() or not power.any():
            raise InputError(
                "powers must be finite and not negative, with at least one above zero (u²)"
            )
        order = np.argsort(f)
        keep = order[power[order] > 0]
        object.__setattr__(self, "frequencies", tuple(f[keep].tolist()))
        object.__setattr__(self, "powers", tuple(power[keep].tolist()))

    def lines(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u²."""
        below_nyquist(self.frequencies[-1], dt)
        return np.array(self.frequencies), np.array(self.powers)


@dataclass(frozen=True)
class FilteredSpectrum(InputSpectrum):
    """A spectrum behind a filter: |H|² times ``source``, white noise of variance 1 by default.

    ``system`` is a control system or a tuple (b, a) of polynomials in z at the sequence's own rate,
    highest power first. A discrete system must have the sample time of the sequence; of a
    continuous one the response at jω is taken.

    >>> lag = FilteredSpectrum(([0.1], [1, -0.9]))
    >>> round(lag.power(1e-3), 6)
    0.052632
    """

    system: Filter
    source: InputSpectrum | None = None

    def __post_init__(self) -> None:
        known_filter(self.system)

    def _source(self) -> InputSpectrum:
        return WhiteSpectrum() if self.source is None else self.source

    def density(self, frequency: ArrayLike, dt: float) -> FloatArray:
        """One-sided density in u²/Hz at ``frequency`` (Hz)."""
        return power_gain(self.system, frequency, dt) * self._source().density(frequency, dt)

    def lines(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u²."""
        f, power = self._source().lines(dt)
        return f, power * power_gain(self.system, f, dt)

    def edges(self, dt: float) -> FloatArray:
        """Those of the source."""
        return self._source().edges(dt)


@dataclass(frozen=True)
class SumSpectrum(InputSpectrum):
    """Several independent inputs at once: their powers add."""

    parts: tuple[InputSpectrum, ...]

    def density(self, frequency: ArrayLike, dt: float) -> FloatArray:
        """One-sided density in u²/Hz at ``frequency`` (Hz)."""
        return np.sum([p.density(frequency, dt) for p in self.parts], axis=0)

    def lines(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u²."""
        each = [p.lines(dt) for p in self.parts]
        f, powers = (np.concatenate(x) for x in zip(*each, strict=True))
        at, where = np.unique(f, return_inverse=True)
        return at, np.bincount(where, weights=powers, minlength=len(at))

    def edges(self, dt: float) -> FloatArray:
        """Those of all parts."""
        return np.unique(np.concatenate([p.edges(dt) for p in self.parts]))


@dataclass(frozen=True)
class ScaledSpectrum(InputSpectrum):
    """A spectrum whose powers are multiplied by ``factor``."""

    inner: InputSpectrum
    factor: float

    def __post_init__(self) -> None:
        positive("factor", self.factor)

    def density(self, frequency: ArrayLike, dt: float) -> FloatArray:
        """One-sided density in u²/Hz at ``frequency`` (Hz)."""
        return self.factor * self.inner.density(frequency, dt)

    def lines(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u²."""
        f, power = self.inner.lines(dt)
        return f, self.factor * power

    def edges(self, dt: float) -> FloatArray:
        """Those of the spectrum itself."""
        return self.inner.edges(dt)


def below_nyquist(highest: float, dt: float) -> None:
    """ValueError for energy above the Nyquist limit, which no sequence at ``dt`` can have."""
    nyquist = 0.5 / positive("dt", dt, "s")
    if highest > nyquist * (1 + 1e-9):
        raise InputError(
            f"spectrum has energy at {highest:g} Hz, above {nyquist:g} Hz, the Nyquist limit of "
            f"dt={dt:g} s; lower the band or shorten dt"
        )
