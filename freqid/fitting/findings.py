"""What speaks against an estimate: sentences that know their kind, weight and number."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Protocol, overload

if TYPE_CHECKING:
    import pandas as pd

    from freqid.fitting.estimate import Estimate

Severity = Literal["serious", "minor"]

# part of the input's power that may be folded without harm, and that explains what else is found
FOLDED, MUCH_FOLDED = 0.002, 0.01


class Finding(str):
    """A sentence of ``est.warnings``: a ``str`` with ``kind``, ``severity``, ``number`` and, where
    it is a test's, the ``p_value``.

    >>> found = Finding("edge of a bound", "d=0 is at its bound 0", number=0.0)
    >>> found, found.kind
    ('edge of a bound: d=0 is at its bound 0', 'edge of a bound')
    """

    kind: str
    severity: Severity
    number: float | None
    p_value: float | None

    def __new__(
        cls, kind: str, sentence: str, severity: Severity = "serious",
        number: float | None = None, p_value: float | None = None,
    ) -> Finding:  # fmt: skip
        self = super().__new__(cls, f"{kind}: {sentence}")
        self.kind, self.severity, self.number, self.p_value = kind, severity, number, p_value
        return self

    def saying(self, more: str, severity: Severity | None = None) -> Finding:
        """The same with more to say, and of another weight where one is given."""
        text = f"{self[len(self.kind) + 2 :]}; {more}"
        return Finding(self.kind, text, severity or self.severity, self.number, self.p_value)

    def __getnewargs__(  # type: ignore[override]
        self,
    ) -> tuple[str, str, Severity, float | None, float | None]:
        return self.kind, self[len(self.kind) + 2 :], self.severity, self.number, self.p_value


class Unread(Sequence[Finding]):
    """Findings that are read when somebody asks for them: error bars take a part of a fit's time.

    A pickle takes the findings themselves.
    """

    def __init__(self, read: Callable[[], list[Finding]]) -> None:
        self._read = read

    @cached_property
    def _found(self) -> list[Finding]:
        return self._read()

    def __len__(self) -> int:
        return len(self._found)

    @overload
    def __getitem__(self, index: int) -> Finding: ...

    @overload
    def __getitem__(self, index: slice) -> list[Finding]: ...

    def __getitem__(self, index: int | slice) -> Finding | list[Finding]:
        return self._found[index]

    def __repr__(self) -> str:
        return repr(self._found)

    def __reduce__(self) -> tuple[type[list[Finding]], tuple[list[Finding]]]:
        return list, (self._found,)


class Inquired(Protocol):
    """What asks every suspect when it is wanted."""

    def table(self) -> pd.DataFrame:
        """The suspects by name."""
        ...

    def findings(self) -> list[Finding]:
        """Sentences on those that are no chance."""
        ...

    def on_modes(self, est: Estimate, changed: bool) -> list[Finding]:
        """Modes of a black box that are noise, or, unless a change was said, move midway."""
        ...

    def on_memory(self, est: Estimate) -> list[Finding]:
        """A hold in place of the one that the data remember."""
        ...

    def spread(self, est: Estimate) -> pd.DataFrame:
        """How far the numbers of an estimate move between parts of its data."""
        ...


def between_parts(rows: Sequence[tuple[object, ...]] = ()) -> pd.DataFrame:
    """The table of ``Estimate.spread``; empty, with its columns, where there is nothing to tell."""
    import pandas as pd

    columns = ["between", "parameter", "parts", "value", "shift", "percent", "p_value", "std",
               "widened"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns).set_index(["between", "parameter"])


def suspects_table(rows: Mapping[str, Sequence[object]] | None = None) -> pd.DataFrame:
    """The table of ``Estimate.suspects``, a row each by its name; empty, with its columns, where
    there is nothing to tell.
    """
    import pandas as pd

    columns = ["statistic", "p_value", "size", "unit", "power", "largest_shift"]
    frame = pd.DataFrame.from_dict(dict(rows or {}), orient="index", columns=columns)
    frame.index.name = "suspect"
    return frame
