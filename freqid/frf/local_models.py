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
from dataclasses import replace

import numpy as np

from freqid.checks import FloatArray, InputError, whole
from freqid.data import (
    FrequencyResponse,
    LocalResponse,
    Record,
    Reference,
    as_band,
    as_records,
    chosen,
    references_of,
    that_estimates,
)
from freqid.frf.local_equations import Form, Lines
from freqid.frf.local_lines import among_driven, dense, reached, referred, some
from freqid.frf.local_windows import inflation, local_models
from freqid.frf.measured import aliased_of, measured
from freqid.frf.spectra import spectra
from freqid.lti import tuned

# where the noise of a response is so many times what one input without a transient would leave, in
# one window of ten, windows are widened, up to a part of all lines
_INFLATED, _WIDEST = 10.0, 0.15
# and where polynomials remain useless all the same
_HOPELESS = 100.0
# inputs whose spectra have so small an eigenvalue are the same
_DEPENDENT = 1e-12


@that_estimates
def local_polynomial(
    records: Record | Sequence[Record],
    order: int = 2,
    *,
    band: tuple[float, float] | None = None,
    width: int | None = None,
    reference: Reference | None = None,
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
        reference: for closed loop, as in ``h1``; lines that it does not move are left out.

    Returns a FrequencyResponse (outputs, inputs, K) at the DFT lines with its variance; its
    ``coherence`` is the part of the output's power in each window that is not noise. Polynomials
    suit inputs whose DFT is rough, such as noise; for a chirp take ``local_rational``. Raises
    ValueError for windows that are too narrow, a record that is too short, and an input of three
    periods and more, which drives too few of the lines (see ``periodic``).

    Source: Pintelon and Schoukens, 2012, section 7.2.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    >>> local_polynomial(record, band=(1, 100))
    <LocalResponse 1x1: 397 lines, 1-100 Hz, dt=0.001 s>
    """
    return _estimate(records, order, 0, band, width, reference)


@that_estimates
def local_rational(
    records: Record | Sequence[Record],
    order: int = 3,
    *,
    band: tuple[float, float] | None = None,
    width: int | None = None,
    reference: Reference | None = None,
) -> FrequencyResponse:
    """Response by local rational functions: as ``local_polynomial``, and sharp modes as they are.

    ``order`` is that of numerator, transient and common denominator. Arguments, result and errors
    as in ``local_polynomial``. In strong noise the local polynomial is the safer one: the
    denominator is fitted to noisy outputs. Of an input of few lines, as a multisine may be, it
    gives these alone, each by itself, and others where enough are driven around them.

    >>> import freqid as fq
    >>> u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
    >>> frf = local_rational(fq.simulate(fq.two_mass(), u, dt=0.5e-3), band=(10, 80))
    >>> true = fq.two_mass().frequency_response(frf.omega, fq.ZeroOrderHold(0.5e-3)).response
    >>> bool(np.sqrt(np.mean(np.abs(frf.response / true - 1) ** 2)) < 3e-5)
    True
    """
    return _estimate(records, order, order, band, width, reference)


@tuned
def _estimate(
    records: Record | Sequence[Record],
    order: int,
    poles: int,
    band: tuple[float, float] | None,
    width: int | None,
    reference: Reference | None,
) -> FrequencyResponse:
    sets = as_records(records)
    signals = references_of(sets, reference)
    form = _form(sets, whole("order", order, least=0), poles, width)
    lines = _lines(sets, signals, band, form.width)
    _told_apart(lines, sets[0])
    if not poles:
        dense(lines, form.width)
    fractions, asked = poles > 0 and signals is None, lines.wanted
    told = reached(lines, form, sets) if fractions else lines
    if told.lone is not None:
        lines, form = told, form if width else among_driven(told, form)
    elif width is None:
        lines, form = _widened(sets, signals, band, lines, form)
        asked = lines.wanted
        # what is lone in a wide window only is the end of what a sweep drives
        lines = replace(reached(lines, form, sets), lone=None) if fractions else lines
    else:
        lines = told
    lines = some(lines, asked)
    local = local_models(lines, form, 0 if signals is None else sets[0].n_inputs)
    spectrum = None
    if signals is None:
        spectrum = (np.abs(lines.U[..., lines.wanted]) ** 2).mean(axis=0)
    frf = measured(
        sets[0],
        lines.frequency[lines.wanted],
        *local[:3],
        spectrum,
        form.width - 1,
        aliased_of(sets),
    )
    freedom = form.width * len(sets) - _unknown(form.order, form.poles, *lines.U.shape[:2])
    return LocalResponse(**frf.__dict__, line_noise=local.noise, freedom=float(freedom))


def _told_apart(lines: Lines, first: Record) -> None:
    """ValueError for inputs that are the same at all lines of all experiments."""
    U = np.moveaxis(lines.U, 1, 0).reshape(lines.U.shape[1], -1)
    size = np.linalg.norm(U, axis=1, keepdims=True)
    unit = U / np.where(size > 0, size, 1)
    least = np.linalg.eigvalsh(unit @ unit.conj().T)[0]
    if len(U) > 1 and least < _DEPENDENT:
        raise InputError(
            f"inputs {', '.join(first.input_names)} depend on one another at every line, so that "
            "their effects cannot be told apart; excite them differently"
        )


def _form(sets: Sequence[Record], order: int, poles: int, width: int | None) -> Form:
    """Orders and a width with more equations than unknowns; ValueError for one with fewer."""
    E = len(sets)
    unknown = _unknown(order, poles, E, sets[0].n_inputs)
    if width is None:
        # polynomials bend soon: a third more equations than unknowns; fractions may have more
        width = max(int((1.7 if poles else 1.34) * unknown / E) + 1, 2 * order + 3) | 1
    width = whole("width", width, least=3)
    if width % 2 == 0:
        raise InputError(f"width={width} must be odd: a line and as many on each side")
    if width * E <= unknown:
        raise InputError(
            f"width={width} gives {width * E} equations for {unknown} unknowns; widen it"
        )
    return Form(order, poles, width)


def _unknown(order: int, poles: int, experiments: int, inputs: int) -> int:
    """Unknowns of a window."""
    return (order + 1) * (inputs + experiments) + poles


def _widened(
    sets: Sequence[Record],
    signals: Sequence[FloatArray] | None,
    band: tuple[float, float] | None,
    lines: Lines,
    form: Form,
) -> tuple[Lines, Form]:
    """Wider windows where an input as smooth as a chirp's hides in the transient."""
    most = min(int(_WIDEST * len(lines.frequency)), (20 if form.poles else 3) * form.width)
    inflated = inflation(lines, form)
    while inflated > _INFLATED and int(1.5 * form.width) | 1 <= most:
        form = form._replace(width=int(1.5 * form.width) | 1)
        lines = _lines(sets, signals, band, form.width)
        inflated = inflation(lines, form)
    if inflated > _HOPELESS and not form.poles:
        warnings.warn(
            "the input's spectrum is so smooth, as a chirp's is, that the local polynomials cannot "
            "tell it from the transient everywhere; use local_rational",
            stacklevel=5,
        )
    return lines, form


def _lines(
    sets: Sequence[Record],
    signals: Sequence[FloatArray] | None,
    band: tuple[float, float] | None,
    width: int,
) -> Lines:
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
        m = signals[0].shape[1]
        names = [f"reference {j + 1}" for j in range(m)] if m > 1 else ["the reference"]
        as_input = [
            spectra(Record(x, r.y, r.dt, input_names=names), limits).U[:, :, 0]
            for x, r in zip(signals, sets, strict=True)
        ]
        Y = np.concatenate([Y, U], axis=1)
        U = np.stack(as_input)[..., inner]
    if len(f) < width:
        raise InputError(f"data hold {len(f)} lines for a window of {width}; narrow the window")
    wanted = chosen(f, asked)
    if signals is not None:
        wanted = wanted & referred(U, width, signals)
        if not wanted.any():
            raise InputError(
                f"the reference is zero over {'all lines' if limits is None else f'band={limits}'}"
                ", and tells nothing there"
            )
    return Lines(U, Y, f, wanted)
