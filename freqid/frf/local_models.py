"""Local models of a response: polynomials or rational functions in windows of a few lines.

Near one line response and transient are smooth: Y(k+r) = G(k+r) U(k+r) + T(k+r) + V with G and T
polynomials in r (Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2012,
chapter 7), or fractions with a common denominator (McKelvey and Guérin, Proc. 16th IFAC Symposium
on System Identification, 2012), which follow a sharp resonance where parabolas do not. The
transient is taken off, and what is left tells the noise, from one record.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.checks import Array, ComplexArray, FloatArray, InputError, whole
from freqid.data.band import as_band, chosen
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.data.record_sets import as_records, references_of
from freqid.frf.spectra import spectra

# windows that are worked on at once
_BLOCK = 256
# where the noise of a response is so many times what one input without a transient would leave, in
# one window of ten, windows are widened, up to a part of all lines
_INFLATED, _WIDEST = 10.0, 0.15
# lines of a window for each line that it serves
_LINES_A_WINDOW = 24
# and where polynomials remain useless all the same
_HOPELESS = 100.0


def local_polynomial(
    records: Record | Sequence[Record],
    order: int = 2,
    *,
    band: tuple[float, float] | None = None,
    width: int | None = None,
    reference: Any = None,
) -> FrequencyResponse:
    """Response by local polynomials: no leakage, and the noise's variance from one record.

    Args:
        records: one, or several experiments; with m inputs there must be so many lines or
            experiments that they can be told apart.
        order: of the polynomials of response and transient.
        band: in Hz, None for all lines.
        width: lines of each window, odd; by default a third more than the unknowns (two thirds
            for ``local_rational``), and wider, up to a point, where the input is so smooth, as a
            chirp's is, that it cannot be told from the transient in so few lines.
        reference: for closed loop, as in ``h1``.

    Returns a FrequencyResponse (outputs, inputs, K) at the DFT lines with its variance; its
    ``coherence`` is the part of the output's power in each window that is not noise. Polynomials
    suit inputs whose DFT is rough, such as noise; for a chirp take ``local_rational``. Raises
    ValueError for windows that are too narrow or a record that is too short.

    Source: Pintelon and Schoukens, 2012, section 7.2.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    >>> local_polynomial(record, band=(1, 100))
    <FrequencyResponse 1x1: 397 lines, 1-100 Hz, dt=0.001 s>
    """
    return _estimate(records, order, 0, band, width, reference)


def local_rational(
    records: Record | Sequence[Record],
    order: int = 3,
    *,
    band: tuple[float, float] | None = None,
    width: int | None = None,
    reference: Any = None,
) -> FrequencyResponse:
    """Response by local rational functions: as ``local_polynomial``, and sharp modes as they are.

    ``order`` is that of numerator, transient and common denominator. Arguments, result and errors
    as in ``local_polynomial``. In strong noise the local polynomial is the safer one: the
    denominator is fitted to noisy outputs.

    >>> import freqid as fq
    >>> u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
    >>> frf = local_rational(fq.simulate(fq.two_mass(), u, dt=0.5e-3), band=(10, 80))
    >>> true = fq.two_mass().frequency_response(frf.omega, fq.ZeroOrderHold(0.5e-3)).response
    >>> bool(np.sqrt(np.mean(np.abs(frf.response / true - 1) ** 2)) < 3e-5)
    True
    """
    return _estimate(records, order, order, band, width, reference)


@dataclass(frozen=True)
class _Lines:
    """E experiments at all lines that windows need, and which of them are wanted."""

    U: ComplexArray  # (E, inputs, K)
    Y: ComplexArray  # (E, outputs, K)
    frequency: FloatArray
    wanted: Any
    first: Record


def _estimate(
    records: Any,
    order: int,
    poles: int,
    band: tuple[float, float] | None,
    width: int | None,
    reference: Any,
) -> FrequencyResponse:
    sets = as_records(records)
    order = whole("order", order, least=0)
    signals = references_of(sets, reference)
    E, m = len(sets), sets[0].n_inputs
    unknown = (order + 1) * (m + E) + poles
    given = width is not None
    if width is None:
        # polynomials bend soon: a third more equations than unknowns; fractions may have more
        width = max(int((1.7 if poles else 1.34) * unknown / E) + 1, 2 * order + 3)
        width += 1 - width % 2
    width = whole("width", width, least=3)
    if width % 2 == 0:
        raise InputError(f"width={width} must be odd: a line and as many on each side")
    if width * E <= unknown:
        raise InputError(
            f"width={width} gives {width * E} equations for {unknown} unknowns; widen it"
        )
    data = _lines(sets, signals, band, width)
    most = min(int(_WIDEST * len(data.frequency)), (20 if poles else 3) * width)
    inflated = 0.0 if given else _inflation(data, order, poles, width)
    while inflated > _INFLATED and int(1.5 * width) | 1 <= most:
        # an input as smooth as a chirp's hides in the transient: wider windows tell them apart
        width = int(1.5 * width) | 1
        data = _lines(sets, signals, band, width)
        inflated = _inflation(data, order, poles, width)
    if inflated > _HOPELESS and not poles:
        warnings.warn(
            "the input's spectrum is so smooth, as a chirp's is, that the local polynomials cannot "
            "tell it from the transient everywhere; use local_rational",
            stacklevel=3,
        )
    G, variance, coherence = _windows(data, order, poles, width)
    if signals is not None:
        G, variance, coherence = _through(G, variance, coherence, m)
    first = sets[0]
    return FrequencyResponse(
        data.frequency[data.wanted],
        np.moveaxis(G, 0, -1),
        dt=first.dt,
        hold=first.hold,
        variance=np.moveaxis(variance, 0, -1),
        coherence=np.moveaxis(coherence, 0, -1),
        input_spectrum=(np.abs(data.U[..., data.wanted]) ** 2).mean(axis=0)
        if signals is None
        else None,
        input_names=first.input_names,
        output_names=first.output_names,
    )


def _lines(
    sets: Sequence[Record],
    signals: Sequence[FloatArray] | None,
    band: tuple[float, float] | None,
    width: int,
) -> _Lines:
    """DFTs of all experiments, at the band and half a window on each side of it."""
    first = sets[0]
    N = min(r.n_samples for r in sets)
    if any(r.n_samples != N for r in sets):
        raise InputError(
            f"records have {sorted({r.n_samples for r in sets})} samples; local models need equal "
            "lengths: cut them with slice()"
        )
    if first.factor > 1:
        raise InputError("records have an input faster than the output; decimate the input first")
    spacing = 1 / (N * first.dt)
    asked, limits = as_band(band, first.nyquist), None
    if asked is not None:
        half = (width // 2 + 1) * spacing
        limits = (max(asked.low - half, 0.0), min(asked.high + half, first.nyquist))
    each = [spectra(r, limits) for r in sets]
    f = each[0].frequency
    # zero and Nyquist are real and say nothing of phases
    inner = each[0].multiplicity == 2
    U = np.stack([s.U[:, :, 0] for s in each])[..., inner]
    Y = np.stack([s.Y for s in each])[..., inner]
    f = f[inner]
    if signals is not None:
        as_input = [
            spectra(Record(x, r.y, r.dt), limits).U[:, :, 0]
            for x, r in zip(signals, sets, strict=True)
        ]
        Y = np.concatenate([Y, U], axis=1)
        U = np.stack(as_input)[..., inner]
    if len(f) < width:
        raise InputError(f"data hold {len(f)} lines for a window of {width}; narrow the window")
    return _Lines(U, Y, f, chosen(f, asked), first)


def _windows(
    data: _Lines, order: int, poles: int, width: int
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """G (K, outputs, inputs), its variance, and the share of the output that is not noise."""
    K = len(data.frequency)
    centres = np.flatnonzero(data.wanted)
    # a wide window serves the few lines around its own: its functions hold for all of them
    served = max(width // _LINES_A_WINDOW, 1)
    own = centres[np.minimum(np.arange(0, len(centres), served) + served // 2, len(centres) - 1)]
    members = np.minimum(np.arange(len(own) * served), len(centres) - 1).reshape(-1, served)
    parts = []
    for start in range(0, len(own), _BLOCK):
        middle = own[start : start + _BLOCK, None]
        # windows at the ends of the data are shifted inwards
        first = np.clip(middle - width // 2, 0, K - width)
        at = first + np.arange(width)
        half = width / 2
        offsets = (centres[members[start : start + _BLOCK]] - middle) / half
        parts.append(_solve(data, at, (at - middle) / half, order, poles, offsets)[:3])
    G, variance, share = (np.concatenate(x)[: len(centres)] for x in zip(*parts, strict=True))
    return G, variance, share


def _inflation(data: _Lines, order: int, poles: int, width: int) -> float:
    """Ninth decile, over some windows, of what input and transient cost one another in noise."""
    K = len(data.frequency)
    centres = np.flatnonzero(data.wanted)
    centres = centres[np.unique(np.linspace(0, len(centres) - 1, 24).astype(int))]
    first = np.clip(centres - width // 2, 0, K - width)
    at = first[:, None] + np.arange(width)
    r = (at - centres[:, None]) / (width / 2)
    inflated = _solve(data, at, r, order, poles, np.zeros((len(at), 1)))[3]
    return float(np.quantile(inflated, 0.9))


def _solve(
    data: _Lines, at: Array, r: FloatArray, order: int, poles: int, offsets: FloatArray
) -> tuple[ComplexArray, FloatArray, FloatArray, FloatArray]:
    """One block of windows by QR; the unknowns are G, then each transient, then denominators.

    ``at`` (W, w) are the lines of the windows, ``r`` where they are relative to the window's own,
    ``offsets`` (W, s) the lines that it serves. Returned are G at these, (W s, outputs, inputs),
    its variance, the share of the output that is not noise, and by how much the noise of G exceeds
    that of U alone, (W,).
    """
    U, Y = data.U[..., at], data.Y[..., at]  # (E, m, W, w), (E, p, W, w)
    E, m, W, w = U.shape
    p = Y.shape[1]
    powers = r[..., None] ** np.arange(order + 1)  # (W, w, R + 1)
    # one size for all inputs and outputs, so that columns are comparable
    u_size = np.sqrt((np.abs(U) ** 2).mean(axis=(0, 3)))  # (m, W)
    u_size = np.where(u_size > 0, u_size, 1)
    y_size = np.sqrt((np.abs(Y) ** 2).mean(axis=(0, 3)))
    y_size = np.where(y_size > 0, y_size, 1)
    U, Y = U / u_size[None, :, :, None], Y / y_size[None, :, :, None]
    R1 = order + 1
    forced = np.einsum("emWw,Wws->Wewms", U, powers).reshape(W, E * w, m * R1)
    free = np.zeros((W, E, w, E, R1), complex)
    for e in range(E):
        free[:, e, :, e] = powers
    columns = np.concatenate([forced, free.reshape(W, E * w, E * R1)], axis=-1)
    target = np.moveaxis(Y, (0, 1, 2, 3), (1, 3, 0, 2)).reshape(W, E * w, p)
    s = offsets.shape[1]
    G = np.empty((W, s, p, m), complex)
    variance = np.empty((W, s, p, m))
    share = np.empty((W, s, p, m))
    near = offsets[..., None] ** np.arange(order + 1)  # (W, s, R + 1)
    inflated = np.zeros(W)
    for o in range(p):
        A, b = columns, target[..., o]
        if poles:
            more = -target[..., o, None] * np.tile(
                r[..., None] ** np.arange(1, poles + 1), (1, E, 1)
            )
            A = np.concatenate([A, more], axis=-1)
        Q, T = np.linalg.qr(A)
        projected = np.einsum("Wnq,Wn->Wq", Q.conj(), b)
        diagonal = np.abs(np.einsum("Wqq->Wq", T))
        floor = 1e-13 * diagonal.max(axis=1, keepdims=True)
        # directions that a window does not excite stay at zero
        weak = diagonal <= floor
        T = T + np.einsum("Wq,qr->Wqr", np.where(weak, 1e30, 0.0), np.eye(T.shape[-1]))
        inverse = np.linalg.inv(T)
        x = np.einsum("Wqr,Wr->Wq", inverse, projected)
        residual = b - np.einsum("Wnq,Wq->Wn", A, x)
        freedom = A.shape[1] - A.shape[2] + weak.sum(axis=1)
        noise = (np.abs(residual) ** 2).sum(axis=1) / freedom
        ratio = y_size[o] / u_size  # (m, W)
        spread = (np.abs(inverse) ** 2).sum(axis=-1)
        inflated = np.maximum(inflated, spread[:, : m * R1 : R1].max(axis=1) * E * w)
        below = np.ones((W, s), complex)
        if poles:
            powers_of_d = offsets[..., None] ** np.arange(1, poles + 1)
            below = below + np.einsum("Wsk,Wk->Ws", powers_of_d, x[:, -poles:])
        for i in range(m):
            above = np.einsum("Wsk,Wk->Ws", near, x[:, i * R1 : (i + 1) * R1])
            scale = ratio[i][:, None]
            G[:, :, o, i] = above / below * scale
            own = noise * spread[:, i * R1] * ratio[i] ** 2
            variance[:, :, o, i] = own[:, None] / np.abs(below) ** 2
            share[:, :, o, i] = np.clip(1 - noise, 0, 1)[:, None]
    flat = (W * s, p, m)
    return G.reshape(flat), variance.reshape(flat), share.reshape(flat), inflated


def _through(
    Z: ComplexArray, variance: FloatArray, share: FloatArray, m: int
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """From reference to [y; u] to the plant: G = G_yr G_ur⁻¹, and its variance to first order."""
    p = Z.shape[1] - m
    back = np.linalg.inv(Z[:, p:])
    G = Z[:, :p] @ back
    # δG = (δG_yr − G δG_ur) G_ur⁻¹; output and input noise are taken as unrelated
    each = variance[:, :p] + np.abs(G) ** 2 @ variance[:, p:]
    return G, each @ np.abs(back) ** 2, share[:, :p, :1].repeat(m, axis=-1)
