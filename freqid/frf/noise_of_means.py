"""Means of spectra over periods, and their covariance where the periods are few."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray

# degrees of freedom that the covariance of one output should have, and one more for each other
# output; lines around one are taken for it until it does
FREEDOM = 14
# part of the noise of a channel that is counted as its own at the least
_ALIKE = 1e-10


@dataclass(frozen=True)
class PeriodMeans:
    """Of the spectra of P periods: their mean (channels, K), the sum of the products of what each
    differs from it by, (K, channels, channels), and the first of them, (channels, K).
    """

    count: int
    mean: ComplexArray
    scatter: ComplexArray
    first: ComplexArray

    @classmethod
    def of(cls, Z: ComplexArray) -> PeriodMeans:
        """Of spectra (P, channels, K)."""
        mean = Z.mean(axis=0)
        left = np.moveaxis(Z - mean, -1, 0)
        return cls(len(Z), mean, left.swapaxes(-1, -2) @ left.conj(), Z[0].copy())

    def beside(self, other: PeriodMeans) -> PeriodMeans:
        """Those of all periods of both, of which the other's came later.

        Source: Chan, Golub and LeVeque, The American Statistician 37, 1983.
        """
        count = self.count + other.count
        step = other.mean - self.mean
        apart = np.einsum("ak,bk->kab", step, step.conj()) * (self.count * other.count / count)
        mean = self.mean + step * (other.count / count)
        return PeriodMeans(count, mean, self.scatter + other.scatter + apart, self.first)

    def at(self, lines: BoolArray) -> PeriodMeans:
        """Those at some of the lines."""
        return PeriodMeans(
            self.count, self.mean[:, lines], self.scatter[lines], self.first[:, lines]
        )

    @property
    def change(self) -> ComplexArray:
        """What the first period differs by from the mean of the others, (channels, K)."""
        return (self.first - self.mean) * (self.count / (self.count - 1))

    @property
    def later(self) -> FloatArray:
        """Variance between the other periods, (channels, K), of two or more.

        Source: Chan, Golub and LeVeque, The American Statistician 37, 1983, from the other side.
        """
        P = self.count
        apart = np.abs(self.change) ** 2 * ((P - 1) / P)
        every = np.einsum("kaa->ak", self.scatter).real
        return np.maximum(every - apart, 0.0) / (P - 2)

    @property
    def covariance(self) -> ComplexArray:
        """That of the mean, (K, channels, channels)."""
        return self.scatter / (self.count - 1) / self.count

    def noise(self, channels: slice) -> FloatArray:
        """Variances of the means of some channels, (channels, K)."""
        return np.einsum("kaa->ak", self.covariance).real[channels]


def means(sets: Sequence[PeriodMeans], p: int) -> tuple[ComplexArray, ComplexArray, int]:
    """Means (E, channels, K) of experiments of as many periods, their covariance (E, K, channels,
    channels) and of how many lines each is; the first ``p`` channels are outputs.

    With few periods lines beside one lend it their noise, as what is smooth: in a loop the noise of
    Y and of U alone is as peaked as the plant, and what the outputs do beside the plant's answer to
    the inputs, Y − G U, is not. Noise of a sensor at the input does not go through the plant: it
    and that of the outputs are smooth, and Y − G U is peaked. What is likelier of both is taken.
    """
    P, (channels, K) = sets[0].count, sets[0].mean.shape
    mean, C = np.stack([s.mean for s in sets]), np.stack([s.covariance for s in sets])
    # what does not scatter at all is still rounded
    rounding = (np.finfo(float).eps * np.abs(mean).max(axis=-1)) ** 2  # (E, channels)
    rounded = rounding[:, None, :, None] * np.eye(channels)
    width = min(-(-(FREEDOM + p - 1) // (P - 1)), K) | 1
    width = min(width, K if K % 2 else K - 1)
    if width > 1:
        G = _ratio(mean, p)
        back = np.broadcast_to(np.eye(channels, dtype=complex), (K, channels, channels)).copy()
        back[:, :p, p:] = G
        away = back.copy()
        away[:, :p, p:] = -G
        beside = away @ C @ away.conj().swapaxes(-1, -2)
        ways = [back @ _smooth(beside, width) @ back.conj().swapaxes(-1, -2), _smooth(C, width)]
        C = min((way + rounded for way in ways), key=lambda way: _unlikely(C, way))
    else:
        C = C + rounded
    return mean, C, width


def _unlikely(C: ComplexArray, smooth: ComplexArray) -> float:
    """How unlikely covariances (E, K, c, c) are where they scatter about smooth ones: less twice
    the logarithm of Wishart's density, over their freedom, up to a constant.
    """
    size = np.sqrt(np.maximum(np.einsum("ekaa->eka", smooth).real, 1e-300))
    each = size[..., :, None] * size[..., None, :]
    # in a loop without a sensor's noise one channel's is the other's: next to singular
    told = smooth / each + _ALIKE * np.eye(C.shape[-1])
    left = np.einsum("ekaa->", np.linalg.solve(told, C / each)).real
    return float(np.sum(np.linalg.slogdet(told)[1]) + 2 * np.sum(np.log(size)) + left)


def _ratio(mean: ComplexArray, p: int) -> ComplexArray:
    """Outputs over inputs, (K, outputs, inputs), of means (E, channels, K)."""
    lines = np.moveaxis(mean, 0, -1).swapaxes(0, 1)  # (K, channels, E)
    return np.asarray(lines[:, :p] @ np.linalg.pinv(lines[:, p:]))


def _smooth(C: ComplexArray, width: int) -> ComplexArray:
    """Means over ``width`` lines (axis 1); at the ends as many as elsewhere, none taken twice."""
    even = scipy.ndimage.uniform_filter1d(C.real, width, axis=1) + (
        1j * scipy.ndimage.uniform_filter1d(C.imag, width, axis=1)
    )
    K = C.shape[1]
    return np.asarray(even[:, np.clip(np.arange(K), width // 2, K - 1 - width // 2)])
