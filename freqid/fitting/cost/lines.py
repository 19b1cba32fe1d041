"""The lines of an experiment as the cost sees them: data, where they are taken, and transient."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, IntArray
from freqid.lti import Hold, PeriodicHold, Plane, on_circle

# lines that hold this part of the input's energy are driven
_ENERGY = 0.999
# so small a part of the lines is few
_FEW = 0.2


@dataclass(frozen=True)
class Lines:
    """DFT lines, or a frequency response, and their weights.

    ``omega`` (K,) in rad/s; ``omega_input`` (K, M) the input's frequencies that fold onto each.
    ``Y`` (outputs, channels, K) and ``U`` (inputs, channels, K·M): one channel for a record, one
    for each input for a frequency response. ``scale`` (outputs, channels, K) multiplies the error;
    where it is one for all channels of a line it is in ``U`` and ``Y`` already (``inside``).
    """

    omega: FloatArray
    omega_input: FloatArray
    U: ComplexArray
    Y: ComplexArray
    scale: FloatArray
    inside: bool

    @classmethod
    def weighted(
        cls,
        omega: FloatArray,
        omega_input: FloatArray,
        U: ComplexArray,
        Y: ComplexArray,
        scale: FloatArray,
    ) -> Lines:
        """The lines with one weight for all channels put into the data once and for all."""
        one = scale[0, 0]
        inside = bool((scale == one).all())
        if inside:
            U, Y = U * np.repeat(one, omega_input.size // len(omega)), Y * one
        return cls(omega, omega_input, U, Y, scale, inside)

    def lent(self, like: Lines) -> Lines:
        """The same with the frequencies, and the weights where they are equal, of other lines."""
        same = self.scale.shape == like.scale.shape and np.array_equal(self.scale, like.scale)
        return dataclasses.replace(
            self, omega=like.omega, omega_input=like.omega_input,
            scale=like.scale if same else self.scale,
        )  # fmt: skip

    def energy(self, moving: bool = False) -> float:
        """Weighted energy of the data, or that of what is ``moving``, constants left out."""
        Y = self.error(self.Y)
        Y = Y[..., self.omega != 0] if moving else Y
        return float(np.vdot(Y, Y).real)

    @property
    def aliases(self) -> int:
        """Input frequencies that fold onto each line, M."""
        return self.omega_input.size // len(self.omega)

    @property
    def counted(self) -> BoolArray:
        """Which lines have a weight, (K,)."""
        kept: BoolArray = np.any(self.scale > 0, axis=(0, 1))
        return kept

    def measured(self) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Of a response: omega (K,) in rad/s, the values (outputs, inputs, K), and what multiplies
        their errors.
        """
        size = np.where(self.scale > 0, self.scale, 1.0)
        return self.omega, self.Y / size if self.inside else self.Y, self.scale

    def error(self, values: ComplexArray) -> ComplexArray:
        """Values (…, outputs, channels, K) with the weights that are not inside yet."""
        return values if self.inside else values * self.scale

    def rows(self, values: ComplexArray) -> FloatArray:
        """Weighted (…, outputs, channels, K) as real rows, (…, 2·outputs·channels·K)."""
        weighted = self.error(values)
        return np.ascontiguousarray(weighted.reshape(*weighted.shape[:-3], -1)).view(float)

    def strongest(self) -> IntArray:
        """Of each line's aliases the one with the most input, as an index into K·M, (K,)."""
        power = np.abs(self.U).sum(axis=(0, 1)).reshape(-1, self.aliases)
        return np.arange(len(power)) * self.aliases + power.argmax(axis=1)

    def spread(self, part: float, evenly: bool) -> tuple[IntArray, FloatArray]:
        """About a ``part`` of the lines that count, and the weight of each: how many it stands for.

        Unless ``evenly`` lines are wanted, those that hold the input's energy, where they are few,
        are half of the part, which tell the response, and the rest the other half, which tell the
        transient and the noise.
        """
        # weights may leave out lines with a period of their own
        counted = np.flatnonzero(self.counted)
        driven = None if evenly else self._few_driven(len(counted))
        if driven is None:
            groups, wanted = [counted], part * len(counted)
        else:
            driven = driven[counted]
            groups, wanted = [counted[driven], counted[~driven]], part * len(counted) / 2
        steps = [max(int(len(group) / wanted * (1 + 1e-9)), 1) for group in groups]
        kept = [group[::step] for group, step in zip(groups, steps, strict=True)]
        weight = np.repeat([float(step) for step in steps], [len(k) for k in kept])
        lines = np.concatenate(kept)
        order = np.argsort(lines)
        return lines[order], weight[order]

    def _few_driven(self, n_counted: int) -> BoolArray | None:
        """Which of the lines that count are the strongest, that hold the input's energy, (K,).

        None where these are no few of the ``n_counted``.
        """
        power = (np.abs(self.U) ** 2).sum(axis=(0, 1)).reshape(-1, self.aliases).sum(axis=1)
        power = np.where(self.counted, power, 0.0)
        few = max(math.ceil(_FEW * n_counted) - 1, 0)
        # to know that they are more takes a part of the time that it takes to sort them
        strong = np.partition(power, len(power) - few)[len(power) - few :] if few else power[:0]
        energy = float(power.sum())
        if not strong.sum() >= _ENERGY * energy > 0:
            return None
        strong = np.sort(strong)[::-1]
        enough = int(np.searchsorted(np.cumsum(strong), _ENERGY * energy))
        least = strong[min(enough, few - 1)]
        driven = np.asarray((power >= least) & self.counted)
        return driven if driven.sum() <= few else None

    def some(self, lines: IntArray, factor: FloatArray) -> Lines:
        """Some of the lines, the data multiplied (lines,) so that costs stay comparable."""
        inputs = runs(lines, self.aliases)
        return Lines(
            self.omega[lines],
            self.omega_input[lines],
            self.U[..., inputs] * np.repeat(factor, self.aliases),
            self.Y[..., lines] * factor,
            self.scale[..., lines],
            self.inside,
        )


# points that tell how far one is from the next: they are even, or closest at the beginning
_SOME = 1000


@dataclass(frozen=True)
class Points:
    """Where the resolvent of the forced response is taken, (K·M,), and the input it meets there."""

    z: ComplexArray
    U: ComplexArray

    @cached_property
    def spacing(self) -> float:
        """The least distance from one of the first points to the next; 0 of one alone."""
        some = self.z[:_SOME]
        return float(np.abs(np.diff(some)).min()) if len(some) > 1 else 0.0

    def some(self, inputs: IntArray, factor: FloatArray) -> Points:
        """At some of the input's lines, each multiplied."""
        return Points(self.z[inputs], self.U[..., inputs] * factor)

    def in_plane(self, plane: Plane, U: ComplexArray) -> Points:
        """Points in z seen in another plane, which the inputs ``U`` drive."""
        z = plane.points(self.z)
        return Points(z, U * plane.input_factor(z))


@dataclass(frozen=True)
class Transient:
    """The free motion at the lines: C (zI − Φ)⁻¹ z δ over the sample time ``dt`` (s) of the output.

    ``z`` and ``factor`` (K·aliases,): several where the plant is known only at a faster period,
    (z^M I − Φ^M)⁻¹ z^M being the mean of (zI − Φ)⁻¹ z over the M aliases. ``shared`` says that the
    resolvent is that of the forced response.
    """

    dt: float
    z: ComplexArray
    factor: ComplexArray
    aliases: int
    shared: bool

    @classmethod
    def of(
        cls, lines: Lines, dt: float, hold: Hold, z_forced: ComplexArray, discrete: bool, lift: int
    ) -> Transient:
        """In the plane of z; ``discrete`` matrices belong to the period of the ``hold``."""
        period = hold.period * lift if isinstance(hold, PeriodicHold) else 0.0
        shared = lines.aliases == 1 and period > 0 and abs(dt / period - 1) < 1e-9
        aliases = 1
        if shared:
            z = z_forced
        elif discrete and isinstance(hold, PeriodicHold):
            aliases = round(dt / hold.period)
            turns = 2 * np.pi * np.arange(aliases) / dt
            z = on_circle((lines.omega[:, None] + turns).ravel() * hold.period)
        else:
            z = on_circle(lines.omega * dt)
        factor = z / aliases
        if lines.inside:
            factor = factor * np.repeat(lines.scale[0, 0], aliases)
        return cls(dt, z, factor, aliases, shared)

    @property
    def weight(self) -> ComplexArray:
        """What multiplies a sample of one at each line, (K,)."""
        return (self.factor / self.z)[:: self.aliases] * self.aliases

    def some(self, lines: IntArray, factor: FloatArray) -> Transient:
        """At some of the lines."""
        at = runs(lines, self.aliases)
        more = np.repeat(factor, self.aliases)
        return dataclasses.replace(self, z=self.z[at], factor=self.factor[at] * more)

    def in_plane(self, plane: Plane) -> Transient:
        """A transient in z seen in another plane."""
        z = plane.points(self.z)
        factor = self.factor / self.z * plane.free_factor(z)
        return dataclasses.replace(self, z=z, factor=factor)


def runs(lines: IntArray, length: int) -> IntArray:
    """Members of the runs of ``length`` that belong to some lines."""
    return (lines[:, None] * length + np.arange(length)).ravel()
