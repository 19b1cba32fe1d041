"""One model fitted to many records: a row a record, failures as rows with their reason."""

from __future__ import annotations

import dataclasses
import inspect
import logging
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import InputError, flag, listed, named_values, path_of, processes, unknown, whole
from freqid.data import DataSet, FrequencyResponse, Record, read
from freqid.fitting.entry import fit
from freqid.fitting.fitters import Near, fitter_of
from freqid.fitting.many.identity import at_conditions, fingerprint
from freqid.fitting.many.running import unordered
from freqid.fitting.many.store import TableStore
from freqid.fitting.many.together import Done, minima
from freqid.fitting.search.descent import uninterrupted
from freqid.models import GreyBox
from freqid.progress import Bar

if TYPE_CHECKING:
    import pandas as pd

_LOG = logging.getLogger(__name__)

# records of a chunk, which is kept or lost as one, with verdicts and without, and from how many on
# processes are worth it
_CHUNK, _QUICK, _FEW = 8, 128, 16

Source = DataSet | str | Path
Row = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class _Task:
    """What every row takes: model, options of ``fit`` and of ``read``, and what is computed."""

    model: object
    options: Mapping[str, object]
    reading: Mapping[str, object]
    verdicts: bool


def fit_many(
    model: object,
    records: Iterable[Source] | Mapping[str, Source],
    path: str | Path | None = None,
    *,
    n_jobs: int | None = None,
    verdicts: bool = True,
    reading: Mapping[str, object] | None = None,
    chunk: int | None = None,
    progress: bool | None = None,
    **fit_options: Any,
) -> pd.DataFrame:
    """One model fitted to many records: a row each.

    Records of one shape are fitted together; those in which something is in doubt, one by one.

    Args:
        model: as in ``fit``.
        records: Records, FrequencyResponses or paths, or these by name.
        path: a .parquet file for the table. Finished rows are safe beside it: asked again after an
            interruption, only what is missing is computed. Another job on the same path is
            refused.
        n_jobs: processes; None is all cores where there are many records, or what
            ``joblib.parallel_config`` says (``backend="dask"`` for a cluster); needs the extra
            ``parallel``.
        verdicts: False leaves out witness, warnings and verdict, which take longer than the fit.
        reading: arguments of ``read`` for paths, ``{"inputs": "torque"}``.
        chunk: records that are kept, or lost, as one; None takes 8, or 128 without verdicts.
        progress: None shows a bar on a terminal, True also lines in a log, False nothing.
        fit_options: of ``fit``: band, hold, weights, start, …

    Columns: ``name``, each parameter and ``<parameter>_std``, ``cost``, ``fit_percent``,
    ``converged``, ``verdict``, ``witness``, ``warnings`` (one text), ``seconds``, and ``error``,
    empty but for a record that could not be read or fitted. Raises ValueError for options that no
    fit takes or a path of another job.

    >>> import freqid as fq
    >>> runs = [fq.simulate(fq.first_order(), fq.white_noise(300, seed=s), 1e-3) for s in range(3)]
    >>> fq.fit_many(fq.first_order(), runs)["a"].round(6).tolist()
    [100.0, 100.0, 100.0]
    """
    import pandas as pd

    fitter_of(model)
    processes(n_jobs)
    flag("verdicts", verdicts)
    if progress is not None:
        flag("progress", progress)
    path = None if path is None else path_of("path", path)
    size = (_CHUNK if verdicts else _QUICK) if chunk is None else whole("chunk", chunk)
    named = _named(records)
    if not named:
        raise InputError("records=[] holds nothing to be fitted")
    task = _Task(
        model,
        _checked("option", fit, fit_options),
        _checked("reading", read, named_values("reading", reading)),
        verdicts,
    )
    names = list(named)
    # a text is a path, whose file may change
    known = {n: Path(s) if isinstance(s, str) else s for n, s in named.items()}
    met = [s.conditions for s in named.values() if not isinstance(s, (str, Path))]
    seen = at_conditions(model, met) if isinstance(model, GreyBox) else ()
    groups = [names[i : i + size] for i in range(0, len(names), size)]
    store = (
        None
        if path is None
        else TableStore(path, fingerprint(task, known, size, seen), "other fits")
    )
    if store is not None and (whole_table := store.whole()) is not None:
        return whole_table
    tables: dict[int, pd.DataFrame] = {}
    for i in range(len(groups)):
        kept = None if store is None else store.chunk(i)
        if kept is not None:
            tables[i] = kept
    missing = [i for i in range(len(groups)) if i not in tables]
    jobs = [[(name, named[name]) for name in groups[i]] for i in missing]
    few = n_jobs is None and len(names) < _FEW
    with Bar(progress, len(groups), len(tables), "fits") as advance:
        for at, rows in unordered(partial(_rows, task), jobs, 1 if few else n_jobs or _cores()):
            tables[missing[at]] = pd.DataFrame(rows)
            if store is not None:
                store.keep(missing[at], tables[missing[at]])
            advance(1)
    table = pd.concat([tables[i] for i in range(len(groups))], ignore_index=True)
    table = table[_columns(table)]
    if store is not None:
        store.finish(table)
    return table


def _cores() -> int | None:
    """All cores, unless joblib has been told otherwise."""
    try:
        from joblib.parallel import get_active_backend
    except ImportError:
        return None
    backend, given = get_active_backend()
    own = type(backend).__name__ == "LokyBackend" and given in (None, 1)
    return -1 if own else None


def _named(records: Iterable[Source] | Mapping[str, Source]) -> dict[str, Source]:
    if isinstance(records, (str, Path, Record, FrequencyResponse)):
        records = [records]
    if isinstance(records, Mapping):
        for name, r in records.items():
            _source(f"records[{name!r}]", r)
        return {str(name): r for name, r in records.items()}
    named: dict[str, Source] = {}
    for i, r in enumerate(listed("records", records)):
        _source(f"records[{i}]", r)
        name = str(r) if isinstance(r, (str, Path)) else f"record {i}"
        if name in named:
            raise InputError(f"records: {name} is there twice")
        named[name] = r
    return named


def _source(name: str, given: object) -> None:
    if not isinstance(given, (str, Path, Record, FrequencyResponse)):
        kind = type(given).__name__
        raise InputError(f"{name} is a {kind}; expected a Record, a FrequencyResponse or a path")


def _checked(what: str, function: Callable[..., object], options: Mapping[str, Any]) -> Row:
    """ValueError for an option that the function does not have."""
    parameters = list(inspect.signature(function).parameters.values())
    # the first is what is fitted or read
    known = [p.name for p in parameters[1:] if p.name != "data"]
    for name in options:
        if name not in known:
            raise InputError(unknown(what, name, known))
    return dict(options)


def _rows(task: _Task, job: Sequence[tuple[str, Source]]) -> list[Row]:
    """A row each: those of one shape together as far as nothing is in doubt, the others alone."""
    rows: list[Row] = []
    taken: list[float] = []
    records: list[DataSet | None] = []
    for name, source in job:
        begin = time.perf_counter()
        row: Row = {"name": name}
        try:
            from_file = isinstance(source, (str, Path))
            records.append(read(source, **task.reading) if from_file else source)  # type: ignore[arg-type]
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


def _fitted(task: _Task, name: str, data: object, done: Done | None) -> Row:
    """What is said of one record; an error is a row, too."""
    if done is not None and not task.verdicts:
        return _values(done.values, done.std, done.cost, done.fit_percent, True) | {"error": ""}
    try:
        options = dict(task.options)
        if done is not None:
            options["start"] = Near(done.values)
        est = fit(task.model, data, **options)  # type: ignore[arg-type]
        uninterrupted(est.message)
        std = np.sqrt(np.diag(est.covariance_matrix)).tolist()
        values, errors = est.values.tolist(), dict(zip(est.names, std, strict=True))
        row = _values(
            dict(zip(est.names, values, strict=True)), errors, est.cost, est.fit_percent,
            est.converged,
        )  # fmt: skip
        if task.verdicts:
            row |= {"verdict": est.verdict.grade, "witness": est.witness.verdict}
            row |= {"warnings": "; ".join(est.warnings)}
        return row | {"error": ""}
    except Exception as error:
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


def _told(name: str, error: Exception) -> str:
    _LOG.info("%s: %s", name, error)
    return f"{type(error).__name__}: {error}"


def _columns(table: pd.DataFrame) -> list[str]:
    """Name first, parameters, then what is said of the fit."""
    last = [
        "cost",
        "fit_percent",
        "converged",
        "verdict",
        "witness",
        "warnings",
        "seconds",
        "error",
    ]
    parameters = [c for c in table.columns if c not in ("name", *last)]
    return ["name", *parameters, *(c for c in last if c in table.columns)]
