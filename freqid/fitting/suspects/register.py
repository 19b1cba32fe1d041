"""Where suspects are known: what draws the columns of one is marked with ``@suspect``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from freqid.checks import FloatArray
from freqid.fitting.suspects.scene import Scene
from freqid.models import Model


@dataclass(frozen=True)
class Columns:
    """Derivatives of the rows by a suspect: one array (c, rows) for each experiment.

    ``unit`` is that of its size. ``trials`` counts the places that the suspect was looked for in.
    ``beside`` are columns that are free, too, and explain nothing of it. ``certain`` is what the
    data themselves show, however little it explains. Lines are weighed by the noise unless
    ``alike``. ``chance`` is what the data themselves allow at least, ``harmful`` the size that
    makes a black box another. ``channels`` are the outputs of its columns, where there are several.
    """

    columns: Sequence[FloatArray]
    unit: str = ""
    trials: int = 1
    detail: str = ""
    beside: Sequence[FloatArray] | None = None
    certain: bool = False
    alike: bool = False
    chance: float = 0.0
    onesided: bool = False
    harmful: float = math.inf
    channels: Sequence[str] = ()


Drawn = Columns | Sequence[Columns] | None
Suspect = Callable[[Scene, Model], Drawn]
Kind = TypeVar("Kind", bound=Suspect)
SUSPECTS: dict[str, Suspect] = {}


def suspect(name: str) -> Callable[[Kind], Kind]:
    """Mark a function as one that draws a suspect's columns: several where it has alternatives,
    None where the data cannot show it.
    """

    def mark(function: Kind) -> Kind:
        SUSPECTS[name] = function
        return function

    return mark
