"""Averaged responses: H1, H2 and Hv over segments and repeats, in closed loop too."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import (
    AveragedResponse,
    FrequencyResponse,
    Record,
    Reference,
    Stream,
    that_estimates,
)
from freqid.frf.measured import measured
from freqid.frf.segments import Averaging, Detrend, Window
from freqid.frf.welch import Spectral, at_driven, powers, spectral


@that_estimates
def h1(
    records: Record | Sequence[Record] | Stream,
    segment: int | None = None,
    *,
    band: tuple[float, float] | None = None,
    window: Window = "hann",
    overlap: float | None = None,
    detrend: Detrend = "constant",
    reference: Reference | None = None,
    state: str | Path | None = None,
    progress: bool | None = None,
) -> FrequencyResponse:
    """S_yu S_uu⁻¹: the least-squares response where the noise is on the output.

    Args:
        records: one, or repeats and experiments of one plant with one sample time, of a faster
            input those samples that outputs have (what they fold is told of the response, and of a
            fit to it; ``etfe`` and fits of the record itself take all); or a stream (see
            ``open``), which takes one pass, and a ``segment`` where its length is not known.
        segment: samples of each segment; by default an eighth of a single record, and the whole of
            each of several.
        band: in Hz, None for all above zero.
        window, overlap, detrend: as scipy.signal.csd takes them, overlap as a part of the segment;
            half by default, none for a boxcar, which suits whole periods.
        reference: for closed loop: True for the records' own ``reference``, or its samples (a list
            of them for several records); the estimate is then S_yr S_ur⁻¹, which feedback leaves
            unbiased.
        state: of a stream, a .npz file in which the sums are kept as they grow: interrupted, or
            after a mistake in the data, a call goes on from there, and one on a log that has grown
            since reads no more than what is new: samples that were read and have changed since are
            seen at its beginning alone. Another stream or other options are refused.
        progress: as in ``fit_many``, over the samples of a stream.

    Returns a FrequencyResponse (outputs, inputs, K) with variance, coherence (multiple, for several
    inputs) and input spectrum, of an input that is the same in all segments, as whole periods are,
    at the lines that it drives. Raises ValueError for records that do not match, too few averages
    for the inputs, a constant channel, or a reference that has nothing to do with the input.

    Source: Bendat and Piersol, Random Data, 2010, chapters 6, 7 and 9; for closed loop Pintelon and
    Schoukens, System Identification, 2012, section 2.6.4.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    >>> bool(np.median(h1(record, 500).coherence) > 0.99)
    True
    """
    averaging = Averaging(segment, band, window, overlap, detrend)
    s = at_driven(spectral(records, averaging, reference, state, progress))
    if s.reference is not None:
        return _joint(s)
    return _response(s, s.yu @ np.linalg.inv(s.uu))


@that_estimates
def h2(
    records: Record | Sequence[Record] | Stream,
    segment: int | None = None,
    *,
    band: tuple[float, float] | None = None,
    window: Window = "hann",
    overlap: float | None = None,
    detrend: Detrend = "constant",
    reference: Reference | None = None,
    state: str | Path | None = None,
    progress: bool | None = None,
) -> FrequencyResponse:
    """S_yy S_uy⁻¹: for noise on the input. Arguments, result and errors as in ``h1``.

    It needs as many outputs as inputs. A ``reference`` leaves noise on neither end: then it is what
    ``h1`` and ``hv`` are, S_yr S_ur⁻¹.
    """
    averaging = Averaging(segment, band, window, overlap, detrend)
    s = at_driven(spectral(records, averaging, reference, state, progress))
    if s.reference is not None:
        return _joint(s)
    if s.yu.shape[-1] != s.yu.shape[-2]:
        raise InputError(
            f"records have {s.yu.shape[-1]} inputs and {s.yu.shape[-2]} outputs; h2 needs as many "
            "outputs as inputs: use h1"
        )
    uy = s.yu.conj().swapaxes(-1, -2)
    G = s.yy @ np.linalg.inv(uy)
    return _scaled(_response(s, G), s, G, np.ones(G.shape))


@that_estimates
def hv(
    records: Record | Sequence[Record] | Stream,
    segment: int | None = None,
    *,
    band: tuple[float, float] | None = None,
    window: Window = "hann",
    overlap: float | None = None,
    detrend: Detrend = "constant",
    reference: Reference | None = None,
    state: str | Path | None = None,
    progress: bool | None = None,
) -> FrequencyResponse:
    """Total least squares, for noise on both ends in proportion to the signals.

    With one input it is the geometric mean of H1 and H2. Arguments, result and errors as in ``h1``;
    with a ``reference`` it is S_yr S_ur⁻¹, as there.

    Source: Rocklin, Crowley and Vold, Proc. 3rd International Modal Analysis Conference, 1985.
    """
    averaging = Averaging(segment, band, window, overlap, detrend)
    s = at_driven(spectral(records, averaging, reference, state, progress))
    if s.reference is not None:
        return _joint(s)
    m, p = s.uu.shape[-1], s.yy.shape[-1]
    G = np.empty((len(s.frequency), p, m), complex)
    for o in range(p):
        joint = np.empty((len(s.frequency), m + 1, m + 1), complex)
        joint[:, :m, :m], joint[:, m, m] = s.uu, s.yy[:, o, o]
        joint[:, m, :m] = s.yu[:, o]
        joint[:, :m, m] = s.yu[:, o].conj()
        size = np.sqrt(powers(joint))
        size = np.where(size > 0, size, 1)
        # the direction with the least power holds nothing but noise
        least = np.linalg.eigh(joint / (size[:, :, None] * size[:, None, :]))[1][:, :, 0] / size
        G[:, o] = (-least[:, :m] / least[:, m:]).conj()
    coherence = _explained(s.yu, np.linalg.inv(s.uu)) / np.maximum(powers(s.yy), 1e-300)
    # its amplitude scatters as the powers do, its phase as that of the cross-spectrum
    share = (1 + np.clip(coherence, 0, 1)[:, :, None]) / 2
    return _scaled(_response(s, G), s, G, np.broadcast_to(share, G.shape))


def _scaled(
    frf: FrequencyResponse, s: Spectral, G: ComplexArray, share: FloatArray
) -> FrequencyResponse:
    """A response whose variance, that of H1, is one of another estimate of like relative error.

    |δG/G|² of H2 is (1 − γ²)/γ² over the averages, as that of H1, and G itself is larger by 1/γ²
    (Bendat and Piersol, Random Data, 2010, section 9.2.2).
    """
    if frf.variance is None:
        return frf
    H1 = np.abs(s.yu @ np.linalg.inv(s.uu)) ** 2
    factor = share * np.abs(G) ** 2 / np.maximum(H1, 1e-300)
    variance = frf.variance * np.moveaxis(factor, 0, -1)
    return AveragedResponse(**{**frf.__dict__, "variance": variance})


def _response(s: Spectral, G: ComplexArray) -> FrequencyResponse:
    """The response with the variance and the coherence that the spectra tell."""
    inverse = np.linalg.inv(s.uu)
    explained = _explained(s.yu, inverse)
    freedom = s.averages - G.shape[-1]
    variance = None
    if freedom > 0.5:
        # what is left is too small by the parameters that were fitted to it
        noise = np.maximum(powers(s.yy) - explained, 0) * s.averages / freedom
        variance = noise[:, :, None] * powers(inverse)[:, None, :] / s.averages
    return _packed(s, G, variance, explained)


def _joint(s: Spectral) -> FrequencyResponse:
    """S_yr S_ur⁻¹ with its variance: what y − G u shows that r does not explain."""
    assert s.reference is not None
    yr, ur, rr = s.reference
    back = np.linalg.inv(ur)
    G = yr @ back
    uy = s.yu.conj().swapaxes(-1, -2)
    Gh = G.conj().swapaxes(-1, -2)
    noise = np.maximum(powers(s.yy - G @ uy - s.yu @ Gh + G @ s.uu @ Gh), 0)
    spread = np.einsum("kmn,knl,kml->km", back.conj().swapaxes(-1, -2), rr, back.swapaxes(-1, -2))
    freedom = max(s.averages - G.shape[-1], 0.5)
    variance = noise[:, :, None] * np.abs(spread)[:, None, :] / freedom
    return _packed(s, G, variance, _explained(yr, np.linalg.inv(rr)))


def _explained(yx: ComplexArray, inverse: ComplexArray) -> FloatArray:
    """The outputs' power that signals x explain, (K, outputs), from S_yx and S_xx⁻¹."""
    return np.einsum("kpm,kmn,kpn->kp", yx, inverse, yx.conj()).real


def _packed(
    s: Spectral, G: ComplexArray, variance: FloatArray | None, explained: FloatArray
) -> FrequencyResponse:
    output = powers(s.yy)
    coherence = np.clip(explained / np.where(output > 0, output, 1), 0, 1)
    shown = np.broadcast_to(coherence[:, :, None], G.shape)
    power = powers(s.uu).T
    frf = measured(s.first, s.frequency, G, variance, shown, power, s.reach, s.aliased)
    freedom = s.averages - G.shape[-1]
    told = freedom if variance is not None and freedom > 0 else None
    return AveragedResponse(**frf.__dict__, memory=s.memory, freedom=told, swept=s.swept)
