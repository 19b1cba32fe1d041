"""Records from and to files. A file that is written appears whole or not at all."""

from __future__ import annotations

import dataclasses
import os
import re
import secrets
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, an, finite, flag, path_of, unknown
from freqid.data.analyser_columns import looks_like_response
from freqid.data.argument_order import read_in_either_order
from freqid.data.clocks import begins_anew
from freqid.data.column_names import known, listed_by_name
from freqid.data.experiments_apart import of_experiment
from freqid.data.logged import kind_of, logged_record
from freqid.data.readers.headings import named_with
from freqid.data.readers.kinds import LOGS, WRITERS, ResponseFile
from freqid.data.record import Record
from freqid.data.remembered import is_kept, kept_in_files
from freqid.data.replacing import check_replacing, has_written
from freqid.data.sources import that_reads
from freqid.data.tables import frame_of
from freqid.data.time_column import with_time
from freqid.lti import Hold

if TYPE_CHECKING:
    import pandas as pd


# what a record says of samples that are not numbers, where none is there yet
_REPAIR = "cut the record there with slice() or repair the samples first"


@read_in_either_order
@that_reads
def read(
    path: str | Path,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    dt: float | None = None,
    hold: Hold | str | None = None,
    reference: str | None = None,
    *,
    time: str | None = None,
    sep: str | None = None,
    decimal: str | None = None,
    columns: Sequence[str] | None = None,
    group: str | None = None,
    units: Mapping[str, str] | None = None,
    start: float | None = None,
    stop: float | None = None,
    detrend: int | None = None,
    resample: bool = False,
) -> Record:
    r"""A record from a file, which is looked at before anything is asked.

    Text tables (.csv, .txt, .dat, .log, .lvm or any other suffix, also .gz, .bz2, .xz, .zip) with
    any separator, decimal sign, comments, units and time; .xlsx (extra ``excel``), .parquet (extra
    ``parquet``), .mat
    (version 7.3 with extra ``hdf5``), .npz, .h5 (extra ``hdf5``) and .uff (data set 58, extra
    ``uff``). Robot logs, whose channels have clocks of their own (see ``channels`` and
    ``Record.from_logs``): .ulg (PX4, extra ``ulog``), .bag, .mcap and folders of ROS 2 bags
    (extra ``ros``), .mf4 (extra ``mdf``).

    Args:
        inputs, outputs, reference: columns, as in ``Record.from_frame``.
        dt: in s, for files without a time; hold: what the input did, where the file, unlike one
            that ``write`` made, does not say.
        time: the column of the time, where its name or its behaviour does not tell.
        sep, decimal: of a text table, where they cannot be found out.
        columns: names for a table that has none.
        group: of a file that holds several tables: HDF5 group, MATLAB structure or sheet.
        units: of channels by name; that of the time is understood (s, ms, µs, ns, min, h).
            ``start``, ``stop`` in s cut the record, ``detrend`` takes a polynomial of that order
            off (see ``Record.detrend``).
        resample: put samples with gaps, jitter or missing values on a regular grid by straight
            lines. Without it they are an error.

    ``record.notes`` says what was taken for what. Raises FileNotFoundError for a missing file,
    ValueError for an empty or damaged one, an unknown suffix or column, missing samples and an
    irregular time; the message lists what was found.

    >>> import tempfile, pathlib, freqid as fq
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "step.csv"
    >>> _ = path.write_text("t [ms];u;y\n0;0,0;0,0\n10;1,0;0,1\n20;1,0;0,5\n")
    >>> fq.read(path).dt, fq.read(path).notes
    (0.01, ("column 't' was taken for the time, in ms",))
    """
    path = path_of("path", path)
    if re.fullmatch(r"\.s\d+p", path.suffix.lower()):
        raise ResponseFile(path)
    if kind_of(path) in LOGS:
        _no_table(path, {
            "dt": dt, "reference": reference, "time": time, "sep": sep, "decimal": decimal,
            "columns": columns, "group": group,
        })  # fmt: skip
        try:
            return _cut(
                logged_record(path, inputs, outputs, hold, units, resample), start, stop, detrend
            )
        except InputError as error:
            text = str(error)
            raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    frame = of_experiment(frame_of(path, sep, decimal, columns, group), inputs, outputs, reference)
    by_name = frame.attrs.get("by_name", False)
    found = frame.attrs.get("found", f"columns {', '.join(map(str, frame.columns))}")
    try:
        for name in units or {}:
            if name not in (*frame.columns, "time", "reference"):
                raise InputError(unknown("units", name, [str(c) for c in frame.columns]))
        ends = known(inputs, frame, "inputs"), known(outputs, frame, "outputs")
        asked = [n for e in ends if e is not None for n in ([e] if isinstance(e, str) else e)]
        signals = bool(asked) and set(asked) <= set(map(str, frame.columns))
        if not signals and looks_like_response(frame, frame.attrs.get("units", {})):
            raise ResponseFile(path)
        told = {**frame.attrs.get("units", {}), **(units or {})}
        frame, said = with_time(frame, time, told, dt, signals=asked if signals else ())
        # which is in s now
        told.pop("time", None)

        def made(rows: pd.DataFrame) -> Record:
            return Record.from_frame(
                rows, known(inputs, rows), known(outputs, rows), dt, hold,
                known(reference, rows), units=told, resample=resample,
            )  # fmt: skip

        try:
            # all rows tell the sample time better than some
            record = made(frame)
        except InputError:
            if (start is None and stop is None) or "time" not in frame.columns:
                raise
            # what is cut off may be damaged
            rows, gone = _cut_rows(frame, start, stop)
            record = made(rows)
            start = None if start is None else max(start - gone, 0.0)
            stop = None if stop is None else stop - gone
        if by_name and not asked and record.input_names != ("u",):
            said.append(listed_by_name(record.input_names[0]))
        notes = dict.fromkeys((*frame.attrs.get("notes", ()), *said, *record.notes))
        return _cut(dataclasses.replace(record, notes=tuple(notes)), start, stop, detrend)
    except ResponseFile:
        raise
    except InputError as error:
        text = str(error).replace(
            _REPAIR, "read(start=, stop=) cuts the file, resample=True fills gaps"
        )
        raise InputError(f"{path}: {text} (found {found})") from None


def _cut_rows(
    frame: pd.DataFrame, start: float | None, stop: float | None
) -> tuple[pd.DataFrame, float]:
    """The rows up to ``stop`` (s), from the last one on that lacks nothing and is none after
    ``start`` (s), and how much later (s) that is: a slower output begins with such a row.
    """
    if stop is not None:
        # of experiments one after another the first
        frame = frame.iloc[: begins_anew(frame["time"].to_numpy(dtype=float))]
        frame = frame[~(frame["time"] > frame["time"].iloc[0] + finite("stop", stop))]
    t = frame["time"].to_numpy(dtype=float)
    if start is None or len(t) == 0 or not np.isfinite(t).all() or (np.diff(t) <= 0).any():
        return frame, 0.0
    whole = frame.notna().all(axis=1).to_numpy()
    usable = np.flatnonzero(whole & (t <= t[0] + finite("start", start)))
    first = int(usable[-1]) if len(usable) else 0
    return frame.iloc[first:], float(t[first] - t[0])


def _no_table(path: Path, given: Mapping[str, object]) -> None:
    """ValueError for what is asked of a log and means columns of a table."""
    for name, value in given.items():
        if value is not None:
            raise InputError(
                f"{path}: {name}={value!r} is for tables; the channels of a log have names and "
                "times of their own: leave it out"
            )


def _cut(record: Record, start: float | None, stop: float | None, detrend: int | None) -> Record:
    if start is not None or stop is not None:
        record = record.slice(start or 0.0, stop)
    return record if detrend is None else record.detrend(detrend)


def write(record: Record, path: str | Path, overwrite: bool = False) -> None:
    """Write a record to the file ``path`` that ``read`` reads: .csv, .parquet or .npz.

    Holds, conditions, units (``torque [N m]``) and what decimation has folded are kept in the file.
    Folders that are missing are made. A file that was read is never replaced, another one that is
    there with ``overwrite``, or where this process wrote it. Raises ValueError for these, for
    another suffix, and for channels whose names could not be read back: those that a file uses
    itself, blank ones, ones in quotes.
    """
    an("record", record, Record)
    path = path_of("path", path)
    kind = path.suffix.lower()
    if kind not in WRITERS:
        raise InputError(f"{path}: {unknown('suffix', path.suffix, WRITERS)}")
    _check_names(record, path)
    check_replacing(path, flag("overwrite", overwrite))
    frame = record.to_frame().assign(**kept_in_files(record))
    # files keep these in columns
    frame.attrs = {}
    frame.columns = [named_with(str(c), record.units.get(str(c), "")) for c in frame.columns]
    with whole_file(path) as beside:
        WRITERS[kind](frame, beside)
    has_written(path)


def _check_names(record: Record, path: Path) -> None:
    for name in (*record.input_names, *record.output_names):
        check_name(name, path, record.reference is not None)


def check_name(name: str, path: Path, has_reference: bool = False) -> None:
    """ValueError for a channel whose name means something else in a file."""
    own = name == "time" or is_kept(name) or (name == "reference" and has_reference)
    if own or name != name.strip(" \t\"'") or not name or not name.isprintable():
        why = "files use that name themselves" if own else "it would be read back as another"
        raise InputError(
            f"{path}: the channel {name!r} cannot be written, {why}; rename it with "
            "input_names=, output_names="
        )


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Errors of the system are of the file ``path``, not of the one beside it, nor of none."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and Path(str(error.filename)).parent != path.parent:
            raise
        if error.errno is None:
            raise type(error)(f"{path}: {error}") from error
        raise type(error)(error.errno, error.strerror, str(path)) from None


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path beside ``path`` to write to, renamed into place when the block ends well."""
    path = Path(path)
    with naming(path):
        # what a link points to is replaced, not the link
        yield from _renamed(path.resolve() if path.is_symlink() else path)


def _renamed(path: Path) -> Iterator[Path]:
    if path.is_dir():
        raise InputError(f"{path} is a folder; expected the name of a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is no file but a device or a pipe; give the name of a file")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError(f"{path}: {path.parent} is no folder; give another name") from None
    beside = path.parent / f".{path.stem}-{secrets.token_hex(8)}{path.suffix}"
    # made here, so that nobody else's is taken and the rights are those of any new file
    made = os.open(beside, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    try:
        if path.exists():
            # who could not read the old one is not to read the new one
            beside.chmod(stat.S_IMODE(path.stat().st_mode))
        os.close(made)
        yield beside
        with beside.open("rb") as file:
            os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
