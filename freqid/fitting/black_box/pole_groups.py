"""Poles as a model loses them: a real one alone, others in pairs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from freqid.checks import ComplexArray

Groups = list[list[complex]]


def in_groups(poles: ComplexArray) -> Groups:
    """Real poles alone, and pairs of conjugates."""
    return [[p] if p.imag == 0 else [p, p.conj()] for p in poles[poles.imag >= 0]]


def joined(groups: Sequence[Sequence[complex]]) -> ComplexArray:
    """All poles of some groups."""
    return np.array([pole for group in groups for pole in group], complex)


def fewer_poles(
    cost: Callable[[ComplexArray], float],
    poles: ComplexArray,
    order: int,
    real: complex = 0.0,
) -> ComplexArray:
    """``order`` of the poles: taken away are, in turn, the real ones and pairs that ``cost`` misses
    least. Where one pole too many is half of a pair, a ``real`` one takes the pair's place.
    """
    groups = in_groups(poles)
    while (over := sum(map(len, groups)) - order) > 0:
        spare: list[complex] = [] if over > 1 or any(len(g) == 1 for g in groups) else [real]
        tried = []
        for i, group in enumerate(groups):
            if len(group) - len(spare) <= over:
                rest = [*groups[:i], *groups[i + 1 :], *([spare] if spare else [])]
                tried.append((cost(joined(rest)), rest))
        groups = min(tried, key=lambda t: t[0])[1]
    return joined(groups)
