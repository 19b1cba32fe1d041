"""Records from and to files. A file that is written appears whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import unknown
from freqid.holds import Hold
from freqid.record import Record

if TYPE_CHECKING:
    import pandas as pd


def read(
    path: str | Path,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    dt: float | None = None,
    hold: Hold | str | None = None,
    reference: str | None = None,
) -> Record:
    """A record from a file; the suffix says which kind (.csv).

    Columns and time as in ``Record.from_frame``; a file written by ``write`` remembers its hold.
    Raises FileNotFoundError for a missing file, ValueError for an empty or damaged one, an unknown
    suffix or column, missing samples and an irregular time.

    >>> import tempfile, pathlib, freqid as fq
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "step.csv"
    >>> fq.write(fq.Record([0.0, 1.0, 1.0], [0.0, 0.0, 0.5], dt=0.01), path)
    >>> fq.read(path).dt
    0.01
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise ValueError(f"{path}: {unknown('suffix', path.suffix, _READERS)}")
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist or is not a file; check the path")
    if path.stat().st_size == 0:
        raise ValueError(f"{path} is empty; expected columns of samples under a line of names")
    try:
        return Record.from_frame(reader(path), inputs, outputs, dt, hold, reference)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write(record: Record, path: str | Path) -> None:
    """Write a record to a file that ``read`` reads; the suffix says which kind (.csv).

    Raises ValueError for an unknown suffix.
    """
    path = Path(path)
    if path.suffix.lower() not in _READERS:
        raise ValueError(f"{path}: {unknown('suffix', path.suffix, _READERS)}")
    with whole_file(path) as beside:
        record.to_frame().to_csv(beside, lineterminator="\n")


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


def _read_csv(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        frame = pd.read_csv(path)
    except pd.errors.EmptyDataError:
        raise ValueError("holds no columns; expected samples under a line of names") from None
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        first = str(error).splitlines()[0]
        raise ValueError(f"is not CSV or is damaged ({first})") from None
    if len(frame) == 0:
        raise ValueError("holds names but no samples")
    return frame


_READERS: dict[str, Callable[[Path], pd.DataFrame]] = {".csv": _read_csv}
