"""A hold of its own for each input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from freqid.checks import InputError
from freqid.lti.holds.hold import Hold


@dataclass(frozen=True)
class InputHolds(Hold):
    """Inputs that did different things between their samples: a converter's, and measured ones."""

    holds: tuple[Hold, ...]

    @property
    def column(self) -> tuple[str, float | bool]:
        """No single column remembers several holds: a file has one for each input."""
        raise InputError(
            "inputs with holds of their own have no column together; take that of each of .holds"
        )

    @staticmethod
    def each(hold: Hold, count: int) -> tuple[Hold, ...]:
        """The hold of each of ``count`` inputs."""
        return hold.holds if isinstance(hold, InputHolds) else (hold,) * count

    @staticmethod
    def joined(holds: Sequence[Hold]) -> Hold:
        """One hold where all are the same."""
        return holds[0] if len(set(holds)) == 1 else InputHolds(tuple(holds))

    def of(self, inputs: Sequence[int]) -> Hold:
        """The holds of some of the inputs."""
        return InputHolds.joined([self.holds[i] for i in inputs])

    @property
    def groups(self) -> list[tuple[Hold, list[int]]]:
        """Each hold with the numbers of its inputs, the periodic ones first."""
        found: dict[Hold, list[int]] = {}
        for i, hold in enumerate(self.holds):
            found.setdefault(hold, []).append(i)
        return sorted(found.items(), key=lambda item: not hasattr(item[0], "period"))
