"""Rows that are finished already, and whether they are of what is asked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from freqid.fitting.many.identity import at_conditions, fingerprint
from freqid.fitting.many.rows import Source, may_pass
from freqid.fitting.many.store import TableStore
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd


def prints_of(model: object, named: Mapping[str, Source]) -> dict[str, str]:
    """Fingerprints of records, or of files as they are, and of the plant at their conditions."""
    seen: dict[tuple[tuple[str, float], ...], str] = {}

    def print_of(source: Source) -> str:
        # a text is a path, whose file may change
        known = Path(source) if isinstance(source, str) else source
        met = {} if isinstance(known, Path) else known.conditions
        key = tuple(sorted(met.items()))
        if key not in seen:
            at = at_conditions(model, [met]) if isinstance(model, GreyBox) else ()
            seen[key] = fingerprint(at)
        return fingerprint(known, seen[key])

    return {name: print_of(source) for name, source in named.items()}


class Known:
    """Rows that are finished already, of a table or of chunks of one."""

    def __init__(
        self, named: Mapping[str, Source], prints: Mapping[str, str], store: TableStore
    ) -> None:
        self.named, self.prints, self.store = named, prints, store
        self.names: set[str] = set()
        self.tables: list[pd.DataFrame] = []

    def finished(self) -> pd.DataFrame | None:
        """The finished table, where it holds every row that is wanted."""
        found = self.store.whole()
        if found is None or not self._same(*found) or len(found[0]) < len(self.named):
            return None
        return None if found[0]["error"].map(may_pass).any() else found[0]

    def begun(self) -> int:
        """Take what is finished of the table and of its chunks; the number of the next chunk."""
        self.names, self.tables = set(), []
        whole_table, number = self.store.whole(), 0
        if whole_table is not None:
            self._same(*whole_table)
            self._take(*whole_table)
        for number_of, table, rows in self.store.chunks():
            self._same(table, rows)
            self._take(table, rows)
            number = number_of + 1
        return number

    def _same(self, table: pd.DataFrame, rows: Mapping[str, str]) -> bool:
        """Whether all rows are of what is asked; ValueError for rows that would be lost.

        A fleet may grow, and a file may change, whose row is done again.
        """
        for name in table["name"]:
            if name not in self.named:
                raise self.store.other(why=f" (a row {name!r}, which is not asked for)")
            changed = rows.get(name) != self.prints[name]
            if changed and not isinstance(self.named[name], (str, Path)):
                raise self.store.other(why=f" ({name!r} is another record)")
        return all(rows.get(name) == self.prints[name] for name in table["name"])

    def _take(self, table: pd.DataFrame, rows: Mapping[str, str]) -> None:
        fits = [
            rows.get(n) == self.prints[n] and n not in self.names and not may_pass(error)
            for n, error in zip(table["name"], table["error"], strict=True)
        ]
        if any(fits):
            some = table[fits]
            self.tables.append(some)
            self.names.update(some["name"])
