"""Which lines of an input local models can tell: those that it drives, and those near enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError
from freqid.data import Record
from freqid.frf.local_equations import Form, Lines

# part of the power of a line's neighbours below which it is not driven, that of the strongest line
# below which none around is, and the part of all that polynomials need: every second line will do
_UNDRIVEN, _SILENT, _FEW = 0.01, 1e-6, 0.45
# driven lines of a window for each unknown of its fraction, from which the others are told
_MORE = 1.7
# part of the power of the strongest line below which the input of few lines drives none: there its
# samples are rounded
_BETWEEN = 1e-10
# parts of the power of lines, and of that of a constant, that are rounding
_ROUNDED, _CONSTANT = 1e-24, 1e-29


def dense(lines: Lines, width: int) -> None:
    """InputError where so few lines are driven, as those of a signal of several periods, that
    polynomials would have to reach from one to the next over a resonance between them.
    """
    power = (np.abs(lines.U) ** 2).sum(axis=(0, 1))
    around = scipy.ndimage.maximum_filter1d(power, width, mode="reflect")
    # a line or two that are far above all others say nothing of these
    largest = np.sort(around)[-min(4 * width, len(around))]
    within = lines.wanted & (around > _SILENT * largest)
    driven = float(np.mean(power[within] > _UNDRIVEN * around[within])) if within.any() else 1.0
    if driven < _FEW:
        part = f"one line of {1 / driven:.0f}" if driven > 0 else "no line"
        raise InputError(
            f"the input drives {part}, as a signal that repeats within the "
            "record or a multisine of few lines does, and polynomials do not reach from one to the "
            "next; average its periods with fq.periodic(record, period=...), cut out one with "
            "slice(), or take local_rational"
        )


def reached(lines: Lines, form: Form, sets: Sequence[Record]) -> Lines:
    """The lines of which those are wanted that are driven, or around which so many are that a
    fraction in between is told; ``lone`` are driven ones without so many around.

    Where one line in a window is driven there is a fraction with any pole next to it, and what it
    is worth elsewhere no noise says; nor does it tell more inputs than there are experiments.
    """
    power = (np.abs(lines.U) ** 2).sum(axis=(0, 1))
    around = scipy.ndimage.maximum_filter1d(power, form.width, mode="reflect")
    driven = (power > _UNDRIVEN * around) & (around > _rounding([r.inputs for r in sets]))
    E, m = lines.U.shape[:2]
    for least in (0.0, _BETWEEN * power.max()):
        driven &= around > least
        near = scipy.ndimage.uniform_filter1d(driven.astype(float), form.width, mode="reflect")
        equations = np.round(near * form.width) * E
        many = (near > _FEW) | (equations >= _MORE * ((form.order + 1) * m + form.poles))
        if (many | ~driven).all():
            break
    lone = driven & ~many & _apart(lines.U, form.width)
    wanted = lines.wanted & (many | lone)
    lone &= wanted
    return replace(lines, wanted=wanted, driven=driven, lone=lone if lone.any() else None)


def some(lines: Lines, asked: BoolArray) -> Lines:
    """The lines, InputError where none of those ``asked`` for (K,) is told."""
    if lines.wanted.any() or lines.driven is None:
        return lines
    driven, m = lines.driven[asked], lines.U.shape[1]
    if not driven.any():
        raise InputError("the input drives no line of the band; give one that it excites")
    raise InputError(
        f"{m} inputs drive one line of {1 / np.mean(driven):.0f}, which does not "
        "tell them apart; fit the record itself, drive more lines, or give as many experiments "
        "as inputs"
    )


def among_driven(lines: Lines, form: Form) -> Form:
    """Windows so wide that they hold as many lines that are not driven as they had lines."""
    assert lines.driven is not None
    assert lines.lone is not None
    near = scipy.ndimage.uniform_filter1d(lines.driven.astype(float), form.width, mode="reflect")
    width = int(form.width / (1 - near[lines.lone].max())) | 1
    width = min(width, (len(lines.frequency) - 1) | 1)
    return form._replace(width=max(width, form.width))


def _apart(U: ComplexArray, width: int) -> BoolArray:
    """Lines (K,) at which the experiments by themselves tell the inputs apart."""
    E, m = U.shape[:2]
    if m > E:
        return np.zeros(U.shape[2], bool)
    largest = scipy.ndimage.maximum_filter1d((np.abs(U) ** 2).sum(axis=0), width, axis=-1)
    scaled = U / np.sqrt(np.where(largest > 0, largest, 1))
    least = np.linalg.svd(np.moveaxis(scaled, 2, 0), compute_uv=False)[:, -1]
    return np.asarray(least**2 > _UNDRIVEN)


def referred(U: ComplexArray, width: int, signals: Sequence[FloatArray]) -> BoolArray:
    """Lines (K,) next to which references move something: elsewhere nothing but noise goes round,
    which tells minus one over the controller.
    """
    power = (np.abs(U) ** 2).sum(axis=(0, 1))
    around = scipy.ndimage.maximum_filter1d(power, width, mode="reflect")
    return np.asarray(around > _rounding(signals))


def _rounding(signals: Sequence[FloatArray]) -> float:
    """Power of a line that is no more than rounding, of the mean power of all and of a constant."""
    return float(sum(_ROUNDED * x.size * x.var() + _CONSTANT * np.vdot(x, x) for x in signals))
