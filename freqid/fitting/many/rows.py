"""A row of what is said of a fit; failures are rows, too."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from freqid.checks import InputError
from freqid.data import DataSet, ResponseFile, alone, read, read_response
from freqid.fitting.entry import fit
from freqid.fitting.fitters import Near
from freqid.fitting.many.together import Done, minima
from freqid.fitting.search.interrupted import uninterrupted
from freqid.lti import keep_freed_memory
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

_LOG = logging.getLogger(__name__)

# columns that say something of a fit
_SAID = (
    "cost", "fit_percent", "converged", "verdict", "witness", "warnings", "seconds", "error"
)  # fmt: skip

_OF_VERDICTS = ("verdict", "witness", "warnings")

# the reason of a row without a process, and how reasons begin that may be others the next time
_ENDED = "the process that computed it was ended: out of memory, or by the plant"
_PASSING = (
    _ENDED, "OSError", "PermissionError", "TimeoutError", "ConnectionError", "MemoryError",
    "ImportError", "ModuleNotFoundError",
)  # fmt: skip

Source = DataSet | str | Path
Row = dict[str, Any]

# arguments of ``read`` that ``read_response`` has, too
_OF_RESPONSES = {"sep", "decimal", "columns", "units"}


@dataclass(frozen=True)
class Task:
    """What every row takes: model, options of ``fit`` and of ``read``, and what is computed."""

    model: object
    options: Mapping[str, object]
    reading: Mapping[str, object]
    verdicts: bool


def rows_of(task: Task, job: Sequence[tuple[str, Source]]) -> list[Row]:
    """A row each: those of one shape together as far as nothing is in doubt, the others alone."""
    keep_freed_memory()
    rows: list[Row] = []
    taken: list[float] = []
    records: list[DataSet | None] = []
    for name, source in job:
        begin = time.perf_counter()
        row: Row = {"name": name}
        try:
            from_file = isinstance(source, (str, Path))
            records.append(_from_file(Path(source), task.reading) if from_file else source)  # type: ignore[arg-type]
        except Exception as error:
            row["error"] = _told(name, error)
            records.append(None)
        rows.append(row)
        taken.append(time.perf_counter() - begin)
    begin = time.perf_counter()
    found = minima(task.model, records, task.options)
    together = sum(f is not None for f in found)
    each = (time.perf_counter() - begin) / max(together, 1)
    for row, data, done, reading in zip(rows, records, found, taken, strict=True):
        begin = time.perf_counter()
        if data is not None:
            row |= _fitted(task, str(row["name"]), data, done)
        row["seconds"] = reading + time.perf_counter() - begin + (each if done else 0.0)
    return rows


def _from_file(path: Path, reading: Mapping[str, object]) -> DataSet:
    """The record of a file, or the response that it holds."""
    try:
        return read(path, **reading)  # type: ignore[arg-type]
    except ResponseFile:
        if other := sorted(set(reading) - _OF_RESPONSES):
            raise InputError(
                f"{path} holds a response; {', '.join(other)} in reading= is for records"
            ) from None
        return read_response(path, **reading)  # type: ignore[arg-type]


def may_pass(error: str) -> bool:
    """Whether a row's reason says nothing of the record itself: a disk, memory, a library."""
    return error.startswith(_PASSING)


def lost_rows(task: Task, job: Sequence[tuple[str, Source]]) -> list[Row]:
    """Rows of a chunk that ends whatever process computes it: its halves in processes of their own,
    down to the record that does it.
    """
    if len(job) == 1:
        return [{"name": job[0][0], "seconds": np.nan, "error": _ENDED}]
    rows: list[Row] = []
    for half in (job[: len(job) // 2], job[len(job) // 2 :]):
        done = alone(partial(rows_of, task), half)
        rows += lost_rows(task, half) if done is None else done
    return rows


def _meant(model: object, options: Mapping[str, object]) -> dict[str, float] | None:
    """Where every record was to begin."""
    if not isinstance(model, GreyBox):
        return None
    begun = dict(cast("Mapping[str, float]", options.get("start") or {}))
    return {p.name: begun.get(p.name, p.value) for p in model.free_parameters}


def _fitted(task: Task, name: str, data: object, done: Done | None) -> Row:
    """What is said of one record; an error is a row, too."""
    if done is not None and not task.verdicts and not getattr(task.model, "ties", {}):
        return _values(done.values, done.std, done.cost, done.fit_percent, True) | {"error": ""}
    try:
        options = dict(task.options)
        if done is not None:
            near = Near(done.values)
            near.meant = _meant(task.model, options)
            options["start"] = near
        est = fit(task.model, data, **options)  # type: ignore[arg-type]
        uninterrupted(est.message)
        told = est.parameters
        row = _values(
            dict(told["value"]), dict(told["std"]), est.cost, est.fit_percent, est.converged
        )  # fmt: skip
        if task.verdicts:
            row |= {"verdict": est.verdict.grade, "witness": est.witness.verdict}
            row |= {"warnings": "; ".join(est.warnings)}
        return row | {"error": ""}
    except (Exception, SystemExit) as error:
        # one bad record, or a plant that fails there, must not take the other rows along
        return {"error": _told(name, error)}


def _values(
    values: Mapping[str, float],
    std: Mapping[str, float],
    cost: float,
    fit_percent: float,
    converged: bool,
) -> Row:
    row: Row = {**values, **{f"{n}_std": s for n, s in std.items()}}
    return row | {
        "cost": float(cost), "fit_percent": float(fit_percent), "converged": bool(converged)
    }  # fmt: skip


def _told(name: str, error: BaseException) -> str:
    _LOG.info("%s: %s", name, error)
    return f"{type(error).__name__}: {error}"


def _named(model: object) -> list[str]:
    """Parameters that a row has a value of."""
    if not isinstance(model, GreyBox):
        return []
    return [*(p.name for p in model.free_parameters), *model.ties]


def in_columns(table: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Name first, parameters, then what is said of the fit, also where none was possible."""
    if "cost" not in table.columns:
        names = _named(task.model)
        said = [c for c in _SAID if task.verdicts or c not in _OF_VERDICTS]
        missing = [*names, *(f"{n}_std" for n in names), *said]
        table = table.assign(**{c: np.nan for c in missing if c not in table.columns})
    parameters = [c for c in table.columns if c not in ("name", *_SAID)]
    return table[["name", *parameters, *(c for c in _SAID if c in table.columns)]]


def free_of_columns(model: object) -> None:
    """ValueError for parameters that are called as a column of the table is."""
    names = _named(model)
    for name in (*names, *(f"{n}_std" for n in names)):
        if name in ("name", *_SAID):
            raise InputError(
                f"model: its parameter {name!r} is called as a column of the table; rename it"
            )
