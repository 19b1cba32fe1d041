"""Witness: what a black box of the plant's order says of an estimate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["complete", "lacking", "absent"]

# level of a gap to a black box below which not even starts that agree tell that nothing is in it
RARE = 0.2


@dataclass(frozen=True)
class Witness:
    """What a black box of the plant's order says of an estimate.

    ``verdict`` is ``"complete"`` (no better minimum is left to find), ``"lacking"`` (the black box
    explains the data so much better: a minimum was missed, or the structure lacks something) or
    ``"absent"`` (there is none, for the reason in the ``sentence``). ``cost`` is the black box's,
    ``f`` on ``degrees`` of freedom the statistic, ``p_value`` its level; NaN where absent.
    """

    verdict: Verdict
    sentence: str
    cost: float = float("nan")
    f: float = float("nan")
    p_value: float = float("nan")
    degrees: tuple[int, int] = (0, 0)

    def __repr__(self) -> str:
        return f"<Witness {self.verdict}: {self.sentence}>"
