"""Finished chunks of a long table on disk, so that it can be interrupted and taken up again."""

from __future__ import annotations

import errno
import hashlib
import shutil
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout

from freqid.checks import InputError
from freqid.data import naming, whole_file

if TYPE_CHECKING:
    import pandas as pd

# what a file says of itself: what was asked, and what each of its rows is of
_KEY, _ROWS = "freqid_map", "freqid_rows"
# characters of a chunk's checksum in its name
_SUM = 16


class TableStore:
    """A Parquet file in the making: a folder of finished chunks beside it, joined at the end.

    ``identity`` is a fingerprint of what was asked; chunks and files of another table are refused,
    which holds ``what``. Chunks are written within a ``with`` block, which one job at a time may
    enter.
    """

    def __init__(self, path: str | Path, identity: str, what: str) -> None:
        self.path, self.identity, self.what = Path(path), identity, what
        if self.path.suffix != ".parquet":
            raise InputError(f"path={str(path)!r} must end in .parquet")
        try:
            import pyarrow  # noqa: F401
        except ImportError:
            raise InputError(
                "path needs pyarrow to write Parquet; pip install 'freqid[parquet]'"
            ) from None
        self.parts = self.path.with_name(f".{self.path.name}.parts")
        self.lock = FileLock(self.parts / "lock", timeout=0)

    def __enter__(self) -> TableStore:
        while True:
            try:
                self.parts.mkdir(parents=True, exist_ok=True)
                self.lock.acquire()
            except Timeout:
                raise InputError(
                    f"path: another job is writing {self.path}; wait for it, or give another path"
                ) from None
            except (FileExistsError, NotADirectoryError):
                raise InputError(
                    f"path={str(self.path)!r}: {self.path.parent} is no folder; give another name"
                ) from None
            except OSError as error:
                with suppress(OSError):  # not where something is kept
                    self.parts.rmdir()
                raise OSError(
                    error.errno,
                    f"{error.strerror}: {self.parts} cannot be locked; give a path on a disk that "
                    "has room and locks",
                    str(self.path),
                ) from error
            # a job that has just ended takes its folder with it
            if (self.parts / "lock").exists():
                return self
            self.lock.release()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if not any(self._chunks()):
            shutil.rmtree(self.parts, ignore_errors=True)
        with naming(self.path):
            self.lock.release()

    def whole(self) -> tuple[pd.DataFrame, dict[str, str]] | None:
        """The finished table, where there is one, and what its rows are of, by name; ValueError
        when it is of another map.
        """
        return self._read(self.path) if self.path.is_file() else None

    def chunks(self) -> Iterator[tuple[int, pd.DataFrame, dict[str, str]]]:
        """All finished chunks in turn: number, table, and what its rows are of, by name."""
        for part in sorted(self._chunks()):
            yield int(part.name[:6]), *self._read_chunk(part)

    def keep(self, number: int, table: pd.DataFrame, rows: Mapping[str, str] | None = None) -> None:
        """Write a finished chunk, whose ``rows`` are of these."""
        begun = self.parts / f"{number:06d}.parquet"
        self._write(begun, table, rows)
        begun.replace(begun.with_name(f"{number:06d}-{_sum_of(begun)}.parquet"))

    def finish(self, table: pd.DataFrame, rows: Mapping[str, str] | None = None) -> None:
        """Write the whole table and remove the chunks."""
        self._write(self.path, table, rows)
        shutil.rmtree(self.parts, ignore_errors=True)

    def _chunks(self) -> Iterator[Path]:
        return self.parts.glob(f"??????-{'?' * _SUM}.parquet")

    def _write(self, path: Path, table: pd.DataFrame, rows: Mapping[str, str] | None) -> None:
        marked = table.copy(deep=False)
        marked.attrs = {**table.attrs, _KEY: self.identity}
        if rows is not None:
            marked.attrs[_ROWS] = dict(rows)
        try:
            with whole_file(path) as beside:
                marked.to_parquet(beside, index=False)
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            raise OSError(
                error.errno,
                f"no space is left: what is finished is kept in {self.parts}; make room and call "
                "again to go on",
                str(self.path),
            ) from error

    def _read_chunk(self, part: Path) -> tuple[pd.DataFrame, dict[str, str]]:
        if _sum_of(part) != part.stem.rpartition("-")[2]:
            raise InputError(
                f"{part} is no Parquet file or is damaged; remove it, and its rows are done again"
            )
        return self._read(part)

    def _read(self, path: Path) -> tuple[pd.DataFrame, dict[str, str]]:
        import pandas as pd

        try:
            table = pd.read_parquet(path)
        except Exception as error:
            # pyarrow has errors of many kinds for a file that is not what it says
            raise InputError(f"{path} is no Parquet file or is damaged; remove it") from error
        if table.attrs.pop(_KEY, None) != self.identity:
            raise self.other(path)
        return table, table.attrs.pop(_ROWS, {})

    def other(self, path: Path | None = None, why: str = "") -> InputError:
        """The error for a file, or chunks, of another job, and ``why`` it is one."""
        at = self.path if path is None else path
        if at.parent == self.parts or (path is None and not self.path.is_file()):
            return InputError(
                f"{self.parts} holds {self.what}{why}, not finished; give another path, or remove "
                "that folder to lose them"
            )
        return InputError(f"{at} holds {self.what}{why}; give another path or remove it")


def made_by_a_store(path: Path) -> bool:
    """Whether a file is a table that was written here, and no log that somebody measured."""
    import pyarrow.parquet

    try:
        told = pyarrow.parquet.read_schema(path).pandas_metadata or {}
    except (OSError, pyarrow.ArrowException):
        return False
    return _KEY in (told.get("attributes") or {})


def _sum_of(path: Path) -> str:
    with naming(path):
        return hashlib.sha256(path.read_bytes()).hexdigest()[:_SUM]
