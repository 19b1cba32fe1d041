"""What a search aims at: the data's response as black boxes have it, and what they cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from freqid.fitting.cost.box_distance import BoxDistance
from freqid.fitting.search.log_stage import LogResponse
from freqid.fitting.search.stopping import Bound

# damping at which a round begins
_BLUNT = 1.0


def _nothing(damping: float) -> Sequence[LogResponse]:
    return []


def _nowhere() -> Sequence[BoxDistance]:
    return []


@dataclass(frozen=True)
class Guide:
    """``aims`` gives the targets of the first stage from one start, empty for none; ``blunted``
    those of many starts together, at a damping of the responses, and ``near`` the distances from
    the black boxes themselves. ``bound`` is what these cost on the same lines, None where there
    are none; they are ``settled`` where they have come to a minimum.
    """

    aims: Callable[[], Sequence[LogResponse]]
    bound: Bound | None = None
    blunted: Callable[[float], Sequence[LogResponse]] = _nothing
    near: Callable[[], Sequence[BoxDistance]] = _nowhere
    settled: bool = True

    @cached_property
    def targets(self) -> Sequence[LogResponse]:
        """Those of one start, found when they are asked for."""
        return self.aims()

    @cached_property
    def rounds(self) -> list[Sequence[LogResponse]]:
        """Targets of a round of starts, one after the other: from far off the axis onto it."""
        # far off the axis modes find their own over a longer way
        return [t for t in (self.blunted(_BLUNT), self.blunted(0.0) or self.targets) if t]

    @cached_property
    def distances(self) -> Sequence[BoxDistance]:
        """Those of ``near``, found when they are asked for."""
        return self.near()
