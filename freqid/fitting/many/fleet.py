"""One model fitted to many records: a row a record, failures as rows with their reason."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from freqid.checks import InputError, flag, listed, named_values, path_of, processes, whole
from freqid.data import (
    Bar,
    FrequencyResponse,
    Record,
    configured,
    every_core,
    files_of,
    read,
    unordered,
)
from freqid.fitting.entry import fit
from freqid.fitting.fit_options import check_options, known_options
from freqid.fitting.many.identity import fingerprint
from freqid.fitting.many.known import Known, prints_of
from freqid.fitting.many.rows import (
    Source,
    Task,
    free_of_columns,
    in_columns,
    lost_rows,
    rows_of,
)
from freqid.fitting.many.store import TableStore
from freqid.lti import keep_freed_memory

if TYPE_CHECKING:
    import pandas as pd

# records of a chunk, which is kept or lost as one, with verdicts and without, and from how many on
# processes are worth it
_CHUNK, _QUICK, _FEW = 8, 128, 16
# bytes of a chunk on its way to a process: more of them are memory that is new each time, and the
# first chunks keep the others waiting
_BYTES = 2**24


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
        records: Records, FrequencyResponses, paths or patterns of paths, or these by name.
        path: a .parquet file for the table. Finished rows are safe beside it: asked again after an
            interruption, only what is missing is computed. Another job on the same path is
            refused.
        n_jobs: processes; None is all cores where there are many records, or what
            ``joblib.parallel_config`` says (``backend="dask"`` for a cluster); needs the extra
            ``parallel``.
        verdicts: False leaves out witness, warnings and verdict, which take longer than the fit.
        reading: arguments of ``read``, or ``read_response``, for paths, ``{"inputs": "torque"}``.
        chunk: records that are kept, or lost, as one; None takes 8, or without verdicts 128 paths,
            and of records as many as are 16 MB, 8 to 128.
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

    options = known_options("option", fit, fit_options)
    if "start" in options:
        options["start"] = named_values("start", options["start"])
    check_options(model, options)
    processes(n_jobs)
    flag("verdicts", verdicts)
    if progress is not None:
        flag("progress", progress)
    path = None if path is None else path_of("path", path)
    if path is not None and path.is_dir():
        raise InputError(f"path={str(path)!r} is a folder; give the name of a .parquet file")
    asked = None if chunk is None else whole("chunk", chunk)
    named = _named(records)
    if path is not None:
        # a pattern may take in the table of an earlier call
        own = path.resolve()
        named = {n: r for n, r in named.items() if not _is_path(r) or Path(r).resolve() != own}
    if not named:
        raise InputError("records=[] holds nothing to be fitted")
    size = asked or (_CHUNK if verdicts else _chunk(named.values()))
    free_of_columns(model)
    task = Task(
        model,
        options,
        known_options("reading", read, named_values("reading", reading)),
        verdicts,
    )
    if path is None:
        tables = list(_fitted_in_chunks(task, list(named.items()), size, n_jobs, progress, 0))
        return _joined(tables, named, task)
    prints = prints_of(model, named)
    store = TableStore(path, fingerprint(task), "other fits")
    known = Known(named, prints, store)
    if (finished := known.finished()) is not None:
        return _joined([finished], named, task)
    with store:
        # which another job may have finished by now
        if (finished := known.finished()) is not None:
            return _joined([finished], named, task)
        number = known.begun()
        missing = [(name, named[name]) for name in named if name not in known.names]
        kept = list(known.tables)
        for table in _fitted_in_chunks(task, missing, size, n_jobs, progress, len(known.names)):
            store.keep(number, table, {name: prints[name] for name in table["name"]})
            kept.append(table)
            number += 1
        whole_table = _joined(kept, named, task)
        store.finish(whole_table, prints)
    return whole_table


def _chunk(sources: Iterable[Source]) -> int:
    """Records of a chunk without verdicts."""
    most = max((r.u.nbytes + r.y.nbytes for r in sources if isinstance(r, Record)), default=1)
    return min(max(_BYTES // most, _CHUNK), _QUICK)


def _fitted_in_chunks(
    task: Task,
    missing: Sequence[tuple[str, Source]],
    size: int,
    n_jobs: int | None,
    progress: bool | None,
    done: int,
) -> Iterator[pd.DataFrame]:
    """Tables of the rows that are missing, ``size`` of them at a time, as they are finished."""
    import pandas as pd

    keep_freed_memory()
    jobs = [missing[i : i + size] for i in range(0, len(missing), size)]
    # a few are not worth processes of their own, but a cluster that is asked for is
    if n_jobs is None and not configured():
        n_jobs = 1 if len(missing) < _FEW else every_core()
    with Bar(progress, done + len(missing), done, "fits") as advance:
        work, lost = partial(rows_of, task), partial(lost_rows, task)
        for at, rows in unordered(work, jobs, n_jobs, lost):
            yield pd.DataFrame(rows)
            advance(len(jobs[at]))


def _joined(
    tables: Sequence[pd.DataFrame], named: Mapping[str, Source], task: Task
) -> pd.DataFrame:
    """The rows of all chunks, in the order of the records."""
    import pandas as pd

    # a chunk with a failure has columns of objects, which the whole need not have
    table = pd.concat(tables, ignore_index=True).infer_objects()
    order = {name: i for i, name in enumerate(named)}
    table = table.sort_values("name", key=lambda names: names.map(order), ignore_index=True)
    return in_columns(table, task)


def _named(records: Iterable[Source] | Mapping[str, Source]) -> dict[str, Source]:
    if isinstance(records, (str, Path, Record, FrequencyResponse)):
        records = [records]
    # a pandas.Series has items, too, whose names are texts or no names
    items = list(records.items()) if hasattr(records, "items") else []
    if isinstance(records, Mapping) or (items and all(isinstance(n, str) for n, _ in items)):
        for name, r in items:
            _source(f"records[{name!r}]", r)
        each = [(str(name), r) for name, r in items]
        if len(dict(each)) < len(each):
            raise InputError("records: two of its names are the same text; names must differ")
        return dict(each)
    named: dict[str, Source] = {}
    given = listed("records", records)
    for i, r in enumerate(given):
        _source(f"records[{i}]", r)
    every = [f for r in given for f in (files_of(r) if _is_path(r) else [r])]
    for i, r in enumerate(every):
        name = str(r) if _is_path(r) else f"record {i}"
        if name in named:
            raise InputError(f"records: {name} is there twice")
        named[name] = r
    return named


def _is_path(source: object) -> TypeGuard[str | Path]:
    return isinstance(source, (str, Path))


def _source(name: str, given: object) -> None:
    if not isinstance(given, (str, Path, Record, FrequencyResponse)):
        kind = type(given).__name__
        raise InputError(
            f"{name} is a {kind}; expected a Record, a FrequencyResponse or a path; of a stream "
            "give the path, or load() it"
        )
