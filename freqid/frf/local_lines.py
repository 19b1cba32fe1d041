"""Which lines of an input local models can tell: those that it drives, and those near enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError
from freqid.frf.local_windows import Form, Lines

# part of the power of a line's neighbours below which it is not driven, that of the strongest line
# below which none around is, and the part of all that polynomials need: every second line will do
_UNDRIVEN, _SILENT, _FEW = 0.01, 1e-6, 0.45
# driven lines of a window for each unknown of its fraction, from which the others are told
_MORE = 1.7
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


def reached(lines: Lines, form: Form, signals: Sequence[FloatArray]) -> BoolArray:
    """Lines (K,) that are driven, or around which so many are that a fraction in between is told.

    Where one line in a window is driven there is a fraction with any pole next to it, and what it
    is worth elsewhere no noise says; nor does it tell more inputs than there are experiments.
    InputError where no line is told.
    """
    power = (np.abs(lines.U) ** 2).sum(axis=(0, 1))
    around = scipy.ndimage.maximum_filter1d(power, form.width, mode="reflect")
    driven = (power > _UNDRIVEN * around) & (around > _rounding(signals))
    near = scipy.ndimage.uniform_filter1d(driven.astype(float), form.width, mode="reflect")
    E, m = lines.U.shape[:2]
    equations = np.round(near * form.width) * E
    many = (near > _FEW) | (equations >= _MORE * ((form.order + 1) * m + form.poles))
    told = np.asarray(many | driven if m <= E else many)
    if (told & lines.wanted).any():
        return told
    if not (driven & lines.wanted).any():
        raise InputError("the input drives no line of the band; give one that it excites")
    raise InputError(
        f"{m} inputs drive one line of {1 / np.mean(driven[lines.wanted]):.0f}, which does not "
        "tell them apart; fit the record itself, drive more lines, or give as many experiments "
        "as inputs"
    )


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
