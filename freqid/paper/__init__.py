"""The reproduction of "On identification of a flexible mechanical system using decimated data".

IFAC, 2005: ``figures``, ``table2`` and ``equations``, each with the paper's numbers beside ours.
It may import all packages but ``pages`` and ``cli``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from freqid.paper.drawings import draw, save, save_all
from freqid.paper.study import (
    NOTES,
    equations,
    first_order_estimates,
    notch,
    numerator,
    phase_difference,
    study,
    study_records,
    table2,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "NOTES",
    "equations",
    "figure",
    "figures",
    "first_order_estimates",
    "notch",
    "numerator",
    "phase_difference",
    "study",
    "study_records",
    "table2",
]


def figure(number: int) -> Figure:
    """Figure 1 to 10 of the paper as a matplotlib Figure; ValueError for another number.

    >>> len(figure(1).axes)
    2
    """
    return draw(number)


def figures(out: str | Path) -> list[Path]:
    """Write fig01 … fig10 as .png and .pdf into the folder ``out``; returns their paths."""
    return save_all(out)
