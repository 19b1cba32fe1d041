"""Sums of experiments: to a linear plant a multiple, or a difference, is an experiment as well."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from freqid.checks import FloatArray, InputError

if TYPE_CHECKING:
    from freqid.data.signals import Signals

S = TypeVar("S", bound="Signals")
# what has to be the same of two experiments
_ALIKE = ("hold", "input_names", "output_names", "units", "conditions")


def times(record: S, factor: object) -> S:
    """The experiment with all its signals times a number; ValueError for anything else."""
    if isinstance(factor, bool) or not isinstance(factor, int | float | np.number):
        raise InputError(f"a record times {factor!r:.40}; expected a number")
    if not np.isfinite(factor):
        raise InputError(f"a record times {factor!r}; expected a finite number")
    scaled = {n: float(factor) * x for n, x in _signals(record).items()}
    return replace(record, **scaled)  # type: ignore[type-var]


def less(record: S, other: object) -> S:
    """The difference of two experiments; ValueError where they are not alike."""
    if type(other) is not type(record):
        raise InputError(f"a record less a {type(other).__name__}; expected another record")
    for name in ("dt", "input_dt"):
        own, given = getattr(record, name), getattr(other, name)
        if not math.isclose(own, given, rel_tol=1e-9):
            raise InputError(f"records of unlike {name}, {own!r} and {given!r}, have no difference")
    for name in _ALIKE:
        own, given = getattr(record, name, None), getattr(other, name, None)
        if own != given:
            raise InputError(f"records of unlike {name}, {own!r} and {given!r}, have no difference")
    mine, theirs = _signals(record), _signals(other)
    if mine.keys() != theirs.keys():
        raise InputError("one of the records has a reference, and the other none")
    if {n: x.shape for n, x in mine.items()} != {n: x.shape for n, x in theirs.items()}:
        raise InputError("records of unlike lengths have no difference; slice one of them")
    folded = max(getattr(r, "aliased", 0.0) for r in (record, other))
    left = {n: mine[n] - theirs[n] for n in mine}
    return replace(record, aliased=folded, **left)  # type: ignore[type-var]


def _signals(record: object) -> dict[str, FloatArray]:
    if hasattr(record, "u_logged"):
        raise InputError("signals with clocks of their own have no sums; take record.regular()")
    found = {n: getattr(record, n, None) for n in ("u", "y", "reference")}
    return {n: x for n, x in found.items() if x is not None}
