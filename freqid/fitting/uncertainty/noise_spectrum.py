"""The noise that a fit leaves: its spectrum, and weights from it."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.uncertainty.evenness import evenly_spread

# median step of the logarithm of variances from line to line above which they are those of a few
# averages (of ten 0.3), and by how much one is above its neighbours that is none of theirs
_SCATTERED, _TONE = 0.2, 6.0
# autoregressions of at most this order: a resonance that something shakes above a white floor takes
# many; lines that each order needs, orders without a gain after which none is tried, and by how
# much Akaike's criterion has to be lower for more orders than Bayes' takes
_ORDERS, _ORDER_LINES, _IN_VAIN, _CLEARLY = 24, 15, 8, 4.0


def smoothed_power(error: ComplexArray) -> FloatArray:
    """Local mean of |error|² over neighbouring lines, (…, K), for errors (…, K).

    A steep spectrum is made flat by an autoregression first and given its shape back after, which
    keeps the mean over neighbours from filling its valleys and cutting its peaks (prewhitening:
    Blackman and Tukey, The Measurement of Power Spectra, 1958).
    """
    power = np.abs(error) ** 2
    K = power.shape[-1]
    shape = autoregressive(power.reshape(-1, K)).reshape(power.shape)
    return shape * local_mean(power / shape)


def settled(variance: FloatArray) -> FloatArray:
    """Variances (…, K) of lines, those of a few averages as their neighbours have them: as they are
    they scatter from line to line, and the lines that they are too small at would count for most.

    One that is far above its neighbours is a tone's, and stays.
    """
    known = np.isfinite(variance) & (variance > 0)
    if variance.shape[-1] < _ORDER_LINES or not known.all():
        return variance
    scatter = np.median(np.abs(np.diff(np.log(variance), axis=-1)), axis=-1, keepdims=True)
    if not (scatter > _SCATTERED).any():
        return variance
    size = (1,) * (variance.ndim - 1) + (2 * int(np.sqrt(variance.shape[-1])) + 1,)
    middle = scipy.ndimage.median_filter(variance, size, mode="reflect")
    alone = variance > _TONE * middle
    # a tone would lift its neighbours
    smooth = smoothed_power(np.sqrt(np.where(alone, middle, variance)).astype(complex))
    return np.asarray(np.where((scatter > _SCATTERED) & ~alone, smooth, variance))


def _spectrum(error: ComplexArray, n_samples: int = 0) -> FloatArray:
    """The noise's power for errors (channels, K): an autoregression, where that makes it even.

    Of the DFT of ``n_samples``, where they are all of its lines, zero being left out or not.

    Local means beside it would follow the very lines that they are to weigh, of which a parameter
    may have few.
    """
    power = np.abs(error) ** 2
    shape = autoregressive(power, n_samples)
    whitened = power / shape
    local = local_mean(whitened)
    for row, each in enumerate(whitened):
        if evenly_spread(np.sqrt(each)[None]):
            local[row] = each.mean()
    return shape * local


def local_mean(power: FloatArray) -> FloatArray:
    """Mean over neighbouring lines, (…, K), of a power (…, K)."""
    K = power.shape[-1]
    width = min(2 * int(np.sqrt(K)) + 1, K)
    smooth: FloatArray = scipy.ndimage.uniform_filter1d(power, width, axis=-1, mode="reflect")
    # of running sums rounding may leave less than nothing
    return np.maximum(smooth, 0.0)


def autoregressive(power: FloatArray, n_samples: int = 0) -> FloatArray:
    """Spectra of autoregressions for periodograms (channels, K), ones where none is needed.

    Lines of a band count as all there are. The whole DFT of ``n_samples`` has each at its own
    frequency: half a line aside the filter that whitens such noise would remember all of a record.

    Levinson's recursion, the order by Bayes' criterion, or by Akaike's where that is clearly lower
    there (Stoica and Moses, Spectral Analysis of Signals, 2005, sections 3.5.1, C.4 and C.8):
    Bayes' takes too few for a resonance and cuts its peak, Akaike's too many for white noise.
    """
    K = power.shape[1]
    most = min(_ORDERS, K // _ORDER_LINES)
    shape = np.ones(power.shape)
    if most < 1:
        return shape
    every, period = power, 2 * (K - 1)
    if n_samples // 2 in (K - 1, K):
        period = n_samples
        if n_samples // 2 == K:
            every = np.concatenate([power[:, :1], power], axis=1)
    angle = 2 * np.pi * np.arange(period // 2 + 1)[-K:] / period
    r = scipy.fft.irfft(every, period, axis=-1)[:, : most + 1]
    going = r[:, 0] > 0
    left = np.where(going, r[:, 0], 1.0)
    a = np.zeros_like(r)
    a[:, 0] = 1.0
    # penalties of an order by Bayes and by Akaike; the criterion, Akaike's, and the coefficients
    penalties = np.log(2 * K), 2.0
    least = [[2 * K * np.log(left) for _ in range(2)] for _ in penalties]
    kept, gained = [a.copy() for _ in penalties], 0
    for order in range(1, most + 1):
        k = -(a[:, :order] * r[:, order:0:-1]).sum(axis=1) / left
        a[:, : order + 1] += k[:, None] * a[:, order::-1]
        going &= left * (1 - k**2) > 1e-12 * r[:, 0]
        left = np.where(going, left * (1 - k**2), left)
        fitted = 2 * K * np.log(left)
        for penalty, (criterion, akaike), own in zip(penalties, least, kept, strict=True):
            better = going & (fitted + penalty * order < criterion)
            criterion[better] = (fitted + penalty * order)[better]
            akaike[better], own[better] = (fitted + 2 * order)[better], a[better]
            gained = order if better.any() else gained
        if order - gained >= _IN_VAIN:
            break
    clearly = least[0][1] - least[1][1] > _CLEARLY
    chosen = np.where(clearly[:, None], kept[1], kept[0])
    coloured = chosen[:, 1:].any(axis=1)
    if coloured.any():
        z = np.exp(-1j * angle)
        gain = np.abs(np.polynomial.polynomial.polyval(z, chosen[coloured].T)) ** 2
        shape[coloured] = 1 / np.maximum(gain, 1e-300)
    return shape


def noise_weights(error: ComplexArray, n_samples: int) -> FloatArray:
    """1/variance at each line from the errors (outputs, K) that a fit left there.

    In a record's cost, Σ 2|E|²/N, every real value then adds a half, as it does to a response's
    under weights of 1/variance. Outputs have units of their own, and each its own least variance.
    """
    variance = _spectrum(error, n_samples)
    floor = 1e-12 * variance.max(axis=-1, keepdims=True, initial=0)
    # an output without errors has no variance: it counts as what is hardly any of the others
    floor = np.where(floor > 0, floor, floor.max(initial=0))
    weights: FloatArray = n_samples / 2 / np.maximum(variance, np.maximum(floor, 1e-300))
    return weights


def shaped_power(residual: FloatArray, e: SpectralExperiment) -> FloatArray:
    """Noise power at each of the residual's real values: an autoregression's, where that will do.

    Where few lines tell a suspect their own mean would hide what it does there.
    """
    each = residual.view(complex).reshape(-1, e.n_lines)
    if not (e.lines.scale > 0).all():
        return local_power(residual, e)
    power: FloatArray = np.repeat(_spectrum(each).ravel() / 2, 2)
    return power


def local_power(residual: FloatArray, e: SpectralExperiment) -> FloatArray:
    """Local mean of the squared residual, for each of its real values."""
    each = residual.view(complex).reshape(-1, e.n_lines)
    counted = (e.lines.scale > 0).astype(float).reshape(each.shape)
    if counted.all():
        local = smoothed_power(each)
    else:
        local = local_mean(np.abs(each) ** 2) / np.maximum(local_mean(counted), 1e-9)
    # half of a complex error's power is in each of its parts
    power: FloatArray = np.repeat(local.ravel() / 2, 2)
    return power
