"""Records from and to files. A file that is written appears whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from freqid.checks import InputError, unknown
from freqid.data.logged import kind_of, logged_record
from freqid.data.readers.kinds import LOGS, READERS, WRITERS
from freqid.data.record import Record
from freqid.lti import Hold


def read(
    path: str | Path,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    dt: float | None = None,
    hold: Hold | str | None = None,
    reference: str | None = None,
    *,
    units: Mapping[str, str] | None = None,
    start: float | None = None,
    stop: float | None = None,
    detrend: int | None = None,
    resample: bool = False,
) -> Record:
    """A record from a file; the suffix says which kind.

    .csv, .parquet (extra ``parquet``), .mat (version 7.3 with extra ``hdf5``), .npz, .h5 (extra
    ``hdf5``) and .uff (data set 58, extra ``uff``). Robot logs, whose channels have clocks of their
    own (see ``channels`` and ``Record.from_logs``): .ulg (PX4, extra ``ulog``), .bag, .mcap and
    folders of ROS 2 bags (extra ``ros``), .mf4 (extra ``mdf``).

    Args:
        inputs, outputs, reference: columns, as in ``Record.from_frame``.
        dt: in s, for files without a time; hold: what the input did, where the file, unlike one
            that ``write`` made, does not say.
        units: of channels by name. ``start``, ``stop`` in s cut the record, ``detrend`` takes a
            polynomial of that order off (see ``Record.detrend``).
        resample: put samples with gaps, jitter or missing values on a regular grid by straight
            lines; ``record.notes`` says what was done. Without it they are an error.

    Raises FileNotFoundError for a missing file, ValueError for an empty or damaged one, an unknown
    suffix or column, missing samples and an irregular time.

    >>> import tempfile, pathlib, freqid as fq
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "step.csv"
    >>> fq.write(fq.Record([0.0, 1.0, 1.0], [0.0, 0.0, 0.5], dt=0.01), path)
    >>> fq.read(path).dt
    0.01
    """
    path = Path(path)
    if kind_of(path) in LOGS:
        try:
            return _cut(
                logged_record(path, inputs, outputs, hold, units, resample), start, stop, detrend
            )
        except InputError as error:
            text = str(error)
            raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: {unknown('suffix', path.suffix, [*READERS, *LOGS])}")
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist or is not a file; check the path")
    if path.stat().st_size == 0:
        raise InputError(f"{path} is empty; expected columns of samples under a line of names")
    try:
        record = Record.from_frame(
            reader(path), inputs, outputs, dt, hold, reference, units=units, resample=resample
        )
        return _cut(record, start, stop, detrend)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _cut(record: Record, start: float | None, stop: float | None, detrend: int | None) -> Record:
    if start is not None or stop is not None:
        record = record.slice(start or 0.0, stop)
    return record if detrend is None else record.detrend(detrend)


def write(record: Record, path: str | Path) -> None:
    """Write a record to the file ``path`` that ``read`` reads: .csv, .parquet or .npz.

    Raises ValueError for another suffix.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in WRITERS:
        raise InputError(f"{path}: {unknown('suffix', path.suffix, WRITERS)}")
    with whole_file(path) as beside:
        WRITERS[kind](record.to_frame(), beside)


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path beside ``path`` to write to, renamed into place when the block ends well."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    beside = Path(name)
    try:
        yield beside
        # mkstemp makes files private; the finished one gets what any new file would
        mask = os.umask(0)
        os.umask(mask)
        beside.chmod(0o666 & ~mask)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
