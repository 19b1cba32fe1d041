"""Searches that are ended from the keyboard: what they have found, and who goes on after them."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import Solution

# what such a search says
INTERRUPTED = "interrupted: this is the best point so far"


def uninterrupted(message: str) -> None:
    """KeyboardInterrupt where a fit says so: for what goes on after one, such as many fits."""
    if message == INTERRUPTED:
        raise KeyboardInterrupt


def best_so_far(objectives: Sequence[Objective], start: FloatArray) -> Solution | None:
    """What an interrupted search has found on the first of some costs, by the others, or its start.

    None where the cost cannot be computed there.
    """
    known = [cost.least[0] for cost in objectives if cost.least is not None]
    x = known[0] if known else start
    point = objectives[0].point(x)
    return None if point is None else Solution(x, point, False, INTERRUPTED)
