"""Which rows of a fleet's table have changed: single ones, and all from some time on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import BoolArray, FloatArray, InputError, IntArray, finite
from freqid.validation.fleet_rows import FEWEST, check_columns, fitted_rows, there
from freqid.validation.scatter import (
    cautious_variance,
    farthest_row,
    variance_between,
    weighted_median,
)

if TYPE_CHECKING:
    import pandas as pd

# the level at which all rows of good machines together raise an alarm
LEVEL = 0.01
# rows of a machine from which on single ones, and its order, may tell of a change
_LEAST, _FEWEST = 4, 6
# rows of machines that tell their scatter together
_TOGETHER = 24
# scatters beyond which a row counts as no more than that when the order is looked at
_CUT = 4.0
# orders that are tried for each unit of one over the level, and numbers in them at the most
_ORDERS, _NUMBERS = 20, 20_000_000
# runs of rows grow by this factor, and borders of one are looked for so many rows off at most
_LONGER, _REACH = 1.4, 200


def fleet_alarms(
    table: pd.DataFrame,
    parameter: str,
    *,
    by: str | None = None,
    machine: str | None = None,
    level: float = LEVEL,
) -> BoolArray:
    """Rows of ``fit_many`` whose parameter has changed, (rows,).

    Two kinds of change are looked for, each at half of the level: a row that lies farther from its
    neighbours' common value than its standard error and the scatter between rows allow, and a
    lasting one, a step or a drift, after which rows differ from those before it. The latter is
    judged against other orders of the same rows, or by Student's t where few rows have too few
    orders, and needs them in the order of time.

    Args:
        table: of ``fit_many``.
        parameter: one of its parameters.
        by: a column to order the rows by, dates, numbers or ordered categories; they are in order
            else.
        machine: a column that tells machines apart, each of which is compared with itself alone.
        level: probability that any row of a table without a change is marked, rows being
            independent but for what their machine has in common, and normal.

    A machine has to have four rows for a single one to tell, and six for a lasting change. How rows
    scatter beside their errors machines of 24 rows and more tell together.

    Raises ValueError for unknown columns, fewer than three fitted rows, or a level that is none.

    Source: Olshen, Venkatraman, Lucito and Wigler, Biostatistics 5, 2004, for lasting changes.

    >>> import freqid as fq, pandas as pd
    >>> k = 100 + np.sin(7.0 * np.arange(30)) + 6 * (np.arange(30) >= 20)
    >>> np.flatnonzero(fleet_alarms(pd.DataFrame({"k": k, "k_std": 0.5}), "k")).tolist()
    [20, 21, 22, 23, 24, 25, 26, 27, 28, 29]
    """
    if not 0 < finite("level", level) < 1:
        raise InputError(f"level={level!r} must be a probability, above 0 and below 1")
    values, std, kept = fitted_rows(table, parameter)
    check_columns(table, by=by, machine=machine)
    if kept.sum() < FEWEST:
        raise InputError(
            f"parameter={parameter!r}: fewer than three rows were fitted, {int(kept.sum())}; "
            "changes need that many to show"
        )
    rows = np.flatnonzero(kept)
    if by is not None:
        at = there(table, "by", by, rows)
        try:
            rows = rows[np.argsort(at, kind="stable")]
        except TypeError:
            raise InputError(f"by={by!r} holds values that have no order") from None
    groups = [rows]
    if machine is not None:
        names = there(table, "machine", machine, rows)
        groups = [rows[names == name] for name in dict.fromkeys(names.tolist())]
    found = np.zeros(len(table), bool)
    # those that can tell share the level
    told = [group for group in groups if len(group) >= _LEAST]
    fleet = _scatter_of_all(values, std, told)
    for group in told:
        found[group] = _changed(values[group], std[group], level / len(told), fleet)
    return found


def _scatter_of_all(
    values: FloatArray, std: FloatArray, groups: Sequence[IntArray]
) -> float | None:
    """The variance between rows beside their errors that machines show together: few rows of one
    may lie close by chance. None of few rows, or of one machine.
    """
    if len(groups) < 2 or sum(map(len, groups)) < _TOGETHER:
        return None
    left = [(values[g] - np.median(values[g])) * np.sqrt(len(g) / (len(g) - 1)) for g in groups]
    return float(variance_between(np.concatenate(left), std[np.concatenate(groups)]))


def _changed(x: FloatArray, s: FloatArray, level: float, known: float | None) -> BoolArray:
    """Rows of one machine, in the order of time, that have changed, where the variance between them
    beside their errors is ``known`` to be so much at least.
    """
    least = known or 0.0
    borders = _borders(x, s, level / 2, least)
    far = float(scipy.stats.norm.isf(level / 4 / max(len(borders) - 2, 1)))
    while True:
        parts = _Parts(x, s, borders, least)
        if len(borders) == 2:
            break
        # a run cuts off what lies before it, which need not differ from what comes after
        between = np.abs(np.diff(parts.mean)) / np.hypot(parts.std[1:], parts.std[:-1])
        if between.min() > far:
            break
        borders = np.delete(borders, int(np.argmin(between)) + 1)
    between_rows = max(float(cautious_variance(parts.left, s)), least)
    far_off = farthest_row(s, between_rows, level / 2, known)
    found = np.abs(parts.left) > far_off * np.sqrt(s**2 + between_rows)
    away = np.abs(parts.mean - parts.mean[0]) > far * np.hypot(parts.std, parts.std[0])
    away[0] = False
    return np.asarray(found | away[parts.number])


class _Parts:
    """Rows between lasting changes: the ``number`` of each row's part, how far rows lie from the
    middle of theirs, and means of the parts with their standard errors.
    """

    def __init__(self, x: FloatArray, s: FloatArray, borders: IntArray, least: float) -> None:
        count = len(borders) - 1
        self.number = np.repeat(np.arange(count), np.diff(borders))
        each = [self.number == i for i in range(count)]
        rough = np.array([np.median(x[own]) for own in each])
        size = np.sqrt(s**2 + np.maximum(variance_between(x - rough[self.number], s), least))
        size = np.where(size > 0, size, 1e-150)
        middle = np.array([weighted_median(x[own], size[own]) for own in each])
        self.left = x - middle[self.number]
        # single rows far off are no part of the mean
        clear = middle[self.number] + np.clip(self.left, -_CUT * size, _CUT * size)
        weight = np.bincount(self.number, size**-2.0)
        self.mean = np.bincount(self.number, clear / size**2) / weight
        self.std = 1 / np.sqrt(weight)


def _borders(x: FloatArray, s: FloatArray, level: float, least: float) -> IntArray:
    """First rows of the parts between lasting changes, and the number of rows."""
    borders, open_parts = {0, len(x)}, [(0, len(x))]
    while open_parts:
        begin, end = open_parts.pop()
        run = _lasting(x[begin:end], s[begin:end], level, least)
        if run is not None:
            ends = sorted({begin, begin + run[0], begin + run[1], end})
            borders.update(ends)
            open_parts += list(pairwise(ends))
    return np.array(sorted(borders))


def _lasting(x: FloatArray, s: FloatArray, level: float, least: float) -> tuple[int, int] | None:
    """The run of rows, from one up to another, that lies elsewhere than the others; None where
    other orders show as clear a one.
    """
    n = len(x)
    if n < _FEWEST:
        return None
    left = x - np.median(x)
    size = np.sqrt(s**2 + variance_between(left, s))
    if not (size > 0).all():
        return None
    y, w = np.clip(left, -_CUT * size, _CUT * size), 1 / size**2
    first, last = _runs(n)
    seen = _apart(y[None], w[None], first, last)[0]
    at = int(np.argmax(seen))
    run = int(first[at]), int(last[at])
    if 2 / math.comb(n, run[1] - run[0]) > level:
        # other orders are too few to be so rare
        return _sharp(y, w, *run) if _clear(x, s, run, len(first), least) < level else None
    most, rng, beyond = seen.max(), np.random.default_rng(n), 0
    orders = int(min(_ORDERS / level, max(_NUMBERS // len(first), 2 / level)))
    batch = max(min(orders, 1_000_000 // len(first)), 1)
    for begin in range(0, orders, batch):
        order = rng.permuted(np.tile(np.arange(n), (min(batch, orders - begin), 1)), axis=1)
        beyond += int((_apart(y[order], w[order], first, last).max(axis=1) >= most).sum())
        if beyond + 1 > level * (orders + 1):
            return None
    return _sharp(y, w, *run)


def _clear(x: FloatArray, s: FloatArray, run: tuple[int, int], runs: int, least: float) -> float:
    """The chance that normal rows have a run as far off as this one, among so many, by Student's t
    of what scatters within the run and outside of it.
    """
    inside = np.zeros(len(x), bool)
    inside[run[0] : run[1]] = True
    left = x - np.where(inside, np.median(x[inside]), np.median(x[~inside]))
    size = np.sqrt(s**2 + max(float(cautious_variance(left, s)), least))
    if min(inside.sum(), (~inside).sum()) < _FEWEST // 2 or not (size > 0).all():
        return 1.0
    w, freedom = 1 / size**2, len(x) - 2
    parts = [(np.average(x[own], weights=w[own]), w[own].sum()) for own in (inside, ~inside)]
    (one, W), (other, rest) = parts
    left = x - np.where(inside, one, other)
    scale = max(float((w * left**2).sum()) / freedom, 1.0)
    t = abs(one - other) / np.sqrt(scale * (1 / W + 1 / rest))
    return float(min(2 * runs * scipy.stats.t.sf(t, freedom), 1.0))


def _runs(n: int) -> tuple[IntArray, IntArray]:
    """First rows of runs and those after their last ones: every beginning of the rows, and runs
    within of lengths that grow by a part.
    """
    lengths = np.unique(
        (_FEWEST / 2 * _LONGER ** np.arange(np.log(n) / np.log(_LONGER))).astype(int)
    )
    inside = [(np.arange(1, n - k), np.arange(1, n - k) + k) for k in lengths if 2 * k <= n]
    begun = np.arange(1, n)
    return (
        np.concatenate([np.zeros(n - 1, int), *(first for first, _ in inside)]),
        np.concatenate([begun, *(last for _, last in inside)]),
    )


def _apart(y: FloatArray, w: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """How many standard errors runs of rows lie from all others, (orders, runs)."""
    nothing = np.zeros((len(y), 1))
    W = np.concatenate([nothing, np.cumsum(w, axis=1)], axis=1)
    mean = (w * y).sum(axis=1, keepdims=True) / W[:, -1:]
    S = np.concatenate([nothing, np.cumsum(w * (y - mean), axis=1)], axis=1)
    inside = W[:, last] - W[:, first]
    spread = inside * (W[:, -1:] - inside) / W[:, -1:]
    return np.asarray(np.abs(S[:, last] - S[:, first]) / np.sqrt(spread))


def _sharp(y: FloatArray, w: FloatArray, first: int, last: int) -> tuple[int, int]:
    """The run, of those that begin and end within its own length of one, that lies farthest off."""
    n, reach = len(y), min(max(last - first, 2), _REACH)
    begins = np.arange(max(first - reach, 0), min(first + reach, n - 1) + 1) if first else [0]
    ends = np.arange(max(last - reach, 1), min(last + reach, n) + 1)
    each = [a.ravel() for a in np.meshgrid(begins, ends, indexing="ij")]
    kept = (each[1] > each[0]) & (each[1] - each[0] < n)
    begin, end = (a[kept] for a in each)
    at = int(np.argmax(_apart(y[None], w[None], begin, end)[0]))
    return int(begin[at]), int(end[at])
