"""Means of spectra over periods, and their covariance where the periods are few."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray

# degrees of freedom that the covariance of one output should have, and one more for each other
# output; lines around one are taken for it until it does
FREEDOM = 14


def means(Z: ComplexArray, p: int) -> tuple[ComplexArray, ComplexArray, int]:
    """Means (E, channels, K) of spectra (E, P, channels, K), their covariance (E, K, channels,
    channels) and its freedom; the first ``p`` channels are outputs.

    With few periods lines beside one lend it their noise. What the outputs do beside the plant's
    answer to the inputs, Y − G U, is as smooth as they are; in a loop the noise of Y and of U alone
    is as peaked as the plant, and cancels only where both are of one line.
    """
    P, K = Z.shape[1], Z.shape[-1]
    mean = Z.mean(axis=1)
    left = Z - mean[:, None]
    width = min(-(-(FREEDOM + p - 1) // (P - 1)), K) | 1
    width = min(width, K if K % 2 else K - 1)
    if width == 1:
        C = _covariance(left)
    else:
        G = _ratio(mean, p)
        answer = np.einsum("kpm,etmk->etpk", G, left[:, :, p:])
        beside = np.concatenate([left[:, :, :p] - answer, left[:, :, p:]], axis=2)
        back = np.broadcast_to(
            np.eye(Z.shape[2], dtype=complex), (K, Z.shape[2], Z.shape[2])
        ).copy()
        back[:, :p, p:] = G
        C = back @ _smooth(_covariance(beside), width) @ back.conj().swapaxes(-1, -2)
    # what does not scatter at all is still rounded
    rounding = (np.finfo(float).eps * np.abs(mean).max(axis=-1)) ** 2  # (E, channels)
    C = C + rounding[:, None, :, None] * np.eye(C.shape[-1])
    return mean, C, (P - 1) * width


def _ratio(mean: ComplexArray, p: int) -> ComplexArray:
    """Outputs over inputs, (K, outputs, inputs), of means (E, channels, K)."""
    lines = np.moveaxis(mean, 0, -1).swapaxes(0, 1)  # (K, channels, E)
    return np.asarray(lines[:, :p] @ np.linalg.pinv(lines[:, p:]))


def _covariance(left: ComplexArray) -> ComplexArray:
    """Of the mean over periods, (E, K, channels, channels), from deviations (E, P, channels, K)."""
    P = left.shape[1]
    C: ComplexArray = np.einsum("epak,epbk->ekab", left, left.conj()) / (P - 1) / P
    return C


def _smooth(C: ComplexArray, width: int) -> ComplexArray:
    """Means over ``width`` lines (axis 1); at the ends as many as elsewhere, none taken twice."""
    even = scipy.ndimage.uniform_filter1d(C.real, width, axis=1) + (
        1j * scipy.ndimage.uniform_filter1d(C.imag, width, axis=1)
    )
    K = C.shape[1]
    return np.asarray(even[:, np.clip(np.arange(K), width // 2, K - 1 - width // 2)])
