"""Averaged responses: H1, H2 and Hv over segments and repeats, in closed loop too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import (
    AveragedResponse,
    FrequencyResponse,
    Record,
    Reference,
    Stream,
    as_band,
    as_records,
    chosen,
    references_of,
    that_estimates,
)
from freqid.frf.measured import measured
from freqid.frf.segments import (
    Averaging,
    Detrend,
    Window,
    independent,
    memory,
    pieces,
    products,
    shared_lines,
)


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
) -> FrequencyResponse:
    """S_yu S_uu⁻¹: the least-squares response where the noise is on the output.

    Args:
        records: one, or repeats and experiments of one plant with one sample time; or a stream
            (see ``open``), which takes one pass and a ``segment``.
        segment: samples of each segment; by default an eighth of a single record, and the whole of
            each of several.
        band: in Hz, None for all above zero.
        window, overlap, detrend: as scipy.signal.csd takes them, overlap as a part of the segment;
            half by default, none for a boxcar, which suits whole periods.
        reference: for closed loop: True for the records' own ``reference``, or its samples (a list
            of them for several records); the estimate is then S_yr S_ur⁻¹, which feedback leaves
            unbiased.

    Returns a FrequencyResponse (outputs, inputs, K) with variance, coherence (multiple, for several
    inputs) and input spectrum. Raises ValueError for records that do not match, too few averages
    for the inputs, a constant channel, or a reference that has nothing to do with the input.

    Source: Bendat and Piersol, Random Data, 2010, chapters 6, 7 and 9; for closed loop Pintelon and
    Schoukens, System Identification, 2012, section 2.6.4.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    >>> bool(np.median(h1(record, 500).coherence) > 0.99)
    True
    """
    s = _spectral(records, Averaging(segment, band, window, overlap, detrend), reference)
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
) -> FrequencyResponse:
    """S_yy S_uy⁻¹: for noise on the input. Arguments, result and errors as in ``h1``.

    It needs as many outputs as inputs.
    """
    s = _spectral(records, Averaging(segment, band, window, overlap, detrend))
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
) -> FrequencyResponse:
    """Total least squares, for noise on both ends in proportion to the signals.

    With one input it is the geometric mean of H1 and H2. Arguments, result and errors as in ``h1``.

    Source: Rocklin, Crowley and Vold, Proc. 3rd International Modal Analysis Conference, 1985.
    """
    s = _spectral(records, Averaging(segment, band, window, overlap, detrend))
    m, p = s.uu.shape[-1], s.yy.shape[-1]
    G = np.empty((len(s.frequency), p, m), complex)
    for o in range(p):
        joint = np.empty((len(s.frequency), m + 1, m + 1), complex)
        joint[:, :m, :m], joint[:, m, m] = s.uu, s.yy[:, o, o]
        joint[:, m, :m] = s.yu[:, o]
        joint[:, :m, m] = s.yu[:, o].conj()
        size = np.sqrt(_powers(joint))
        size = np.where(size > 0, size, 1)
        # the direction with the least power holds nothing but noise
        least = np.linalg.eigh(joint / (size[:, :, None] * size[:, None, :]))[1][:, :, 0] / size
        G[:, o] = (-least[:, :m] / least[:, m:]).conj()
    coherence = _explained(s.yu, np.linalg.inv(s.uu)) / np.maximum(_powers(s.yy), 1e-300)
    # its amplitude scatters as the powers do, its phase as that of the cross-spectrum
    share = (1 + np.clip(coherence, 0, 1)[:, :, None]) / 2
    return _scaled(_response(s, G), s, G, np.broadcast_to(share, G.shape))


def _scaled(
    frf: FrequencyResponse, s: _Spectral, G: ComplexArray, share: FloatArray
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


@dataclass(frozen=True)
class _Spectral:
    """Averaged spectra at K frequencies, matrices last; E[y uᴴ] is ``yu`` (K, outputs, inputs)."""

    frequency: FloatArray
    uu: ComplexArray
    yu: ComplexArray
    yy: ComplexArray
    averages: float
    first: Record | Stream
    reach: int
    memory: FloatArray | None
    reference: tuple[ComplexArray, ComplexArray, FloatArray] | None = None


def _spectral(
    records: Record | Sequence[Record] | Stream,
    averaging: Averaging,
    reference: Reference | None = None,
) -> _Spectral:
    sets: Sequence[Record | Stream]
    sets = [records] if isinstance(records, Stream) else as_records(records)
    first, m = sets[0], sets[0].n_inputs
    length, step = averaging.cut(sets)
    signals = None
    if reference is not None and reference is not False:
        if isinstance(records, Stream):
            raise InputError("reference: a stream has none; load() it")
        signals = references_of([r for r in sets if isinstance(r, Record)], reference)
    pairs = ["uu", "yu", "yy"] + (["yr", "ur", "rr"] if signals is not None else [])
    total: dict[str, ComplexArray] = {}
    count = 0
    for i, record in enumerate(sets):
        for n, channels in pieces(record, length, step, None if signals is None else signals[i]):
            for spectra in averaging.transforms(channels, length, step):
                for pair in pairs:
                    S = products(spectra[pair[0]], spectra[pair[1]])
                    total[pair] = total.get(pair, 0) + S
            count += n
    f, density = averaging.density(length, first.dt)
    total = {pair: S * density[:, None, None] for pair, S in total.items()}
    keep = chosen(f, as_band(averaging.band, first.nyquist), positive=True)
    mean = {pair: S[keep] / count for pair, S in total.items()}
    averages = independent(averaging.window, length, step, count)
    reach = shared_lines(averaging.window, length)
    if count < m:
        raise InputError(
            f"{count} averages for {m} inputs; their spectra cannot be told apart: use shorter "
            "segments or more experiments"
        )
    _excited(mean["uu"], first)
    joint = None
    if signals is not None:
        joint = mean["yr"], mean["ur"], mean["rr"]
        _related(mean["uu"], mean["ur"], mean["rr"], averages)
    inputs = [r.inputs[:: r.factor].T[:, : r.n_samples] for r in sets if isinstance(r, Record)]
    told = memory(averaging.window, length, step, inputs)
    return _Spectral(
        f[keep], mean["uu"], mean["yu"], mean["yy"], averages, first, reach, told, joint
    )


def _related(uu: ComplexArray, ur: ComplexArray, rr: ComplexArray, averages: float) -> None:
    """ValueError for a reference that has no more to do with the input than chance."""
    level = np.abs(ur) ** 2 / (_powers(uu)[:, :, None] * _powers(rr)[:, None, :])
    related = np.median(level.max(axis=-1))
    if related < 2 / max(averages, 1) and averages > 2:
        raise InputError(
            f"reference has a coherence of {related:.2g} with the input, no more than chance; "
            "it did not drive this experiment"
        )


def _powers(S: ComplexArray) -> FloatArray:
    """The powers on the diagonals of spectral matrices, (K, channels)."""
    return np.einsum("kii->ki", S).real


def _excited(uu: ComplexArray, first: Record | Stream) -> None:
    """ValueError for inputs that stand still, or move together."""
    power = _powers(uu)
    if not (power.max(axis=0) > 0).all():
        silent = first.input_names[int(np.argmin(power.max(axis=0)))]
        raise InputError(f"input {silent!r} is constant in the band; it excites nothing")
    size = np.sqrt(np.where(power > 0, power, 1))
    least = np.linalg.eigvalsh(uu / (size[:, :, None] * size[:, None, :]))[:, 0]
    if uu.shape[-1] > 1 and np.median(least) < 1e-10:
        raise InputError(
            "the inputs move together in every segment, so that their effects cannot be told "
            "apart; use as many different experiments as inputs"
        )


def _response(s: _Spectral, G: ComplexArray) -> FrequencyResponse:
    """The response with the variance and the coherence that the spectra tell."""
    inverse = np.linalg.inv(s.uu)
    explained = _explained(s.yu, inverse)
    freedom = s.averages - G.shape[-1]
    variance = None
    if freedom > 0.5:
        # what is left is too small by the parameters that were fitted to it
        noise = np.maximum(_powers(s.yy) - explained, 0) * s.averages / freedom
        variance = noise[:, :, None] * _powers(inverse)[:, None, :] / s.averages
    return _packed(s, G, variance, explained)


def _joint(s: _Spectral) -> FrequencyResponse:
    """S_yr S_ur⁻¹ with its variance: what y − G u shows that r does not explain."""
    assert s.reference is not None
    yr, ur, rr = s.reference
    back = np.linalg.inv(ur)
    G = yr @ back
    uy = s.yu.conj().swapaxes(-1, -2)
    Gh = G.conj().swapaxes(-1, -2)
    noise = np.maximum(_powers(s.yy - G @ uy - s.yu @ Gh + G @ s.uu @ Gh), 0)
    spread = np.einsum("kmn,knl,kml->km", back.conj().swapaxes(-1, -2), rr, back.swapaxes(-1, -2))
    freedom = max(s.averages - G.shape[-1], 0.5)
    variance = noise[:, :, None] * np.abs(spread)[:, None, :] / freedom
    return _packed(s, G, variance, _explained(yr, np.linalg.inv(rr)))


def _explained(yx: ComplexArray, inverse: ComplexArray) -> FloatArray:
    """The outputs' power that signals x explain, (K, outputs), from S_yx and S_xx⁻¹."""
    return np.einsum("kpm,kmn,kpn->kp", yx, inverse, yx.conj()).real


def _packed(
    s: _Spectral, G: ComplexArray, variance: FloatArray | None, explained: FloatArray
) -> FrequencyResponse:
    output = _powers(s.yy)
    coherence = np.clip(explained / np.where(output > 0, output, 1), 0, 1)
    shown = np.broadcast_to(coherence[:, :, None], G.shape)
    power = _powers(s.uu).T
    frf = measured(s.first, s.frequency, G, variance, shown, power, reach=s.reach)
    return AveragedResponse(**frf.__dict__, memory=s.memory)
