"""Finished chunks of a long table on disk, so that it can be interrupted and taken up again."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import InputError
from freqid.data import whole_file

if TYPE_CHECKING:
    import pandas as pd

_KEY = "freqid_map"


class TableStore:
    """A Parquet file in the making: a folder of finished chunks beside it, joined at the end.

    ``identity`` is a fingerprint of what was asked; chunks and files of another table are refused,
    which holds ``what``.
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

    def whole(self) -> pd.DataFrame | None:
        """The finished table, where there is one; ValueError when it is of another map."""
        return self._read(self.path) if self.path.is_file() else None

    def chunk(self, number: int) -> pd.DataFrame | None:
        """A finished chunk, or None."""
        part = self._part(number)
        return self._read(part) if part.is_file() else None

    def keep(self, number: int, table: pd.DataFrame) -> None:
        """Write a finished chunk."""
        self._write(self._part(number), table)

    def finish(self, table: pd.DataFrame) -> None:
        """Write the whole table and remove the chunks."""
        self._write(self.path, table)
        shutil.rmtree(self.parts, ignore_errors=True)

    def _part(self, number: int) -> Path:
        return self.parts / f"{number:06d}.parquet"

    def _write(self, path: Path, table: pd.DataFrame) -> None:
        marked = table.copy(deep=False)
        marked.attrs = {**table.attrs, _KEY: self.identity}
        with whole_file(path) as beside:
            marked.to_parquet(beside, index=False)

    def _read(self, path: Path) -> pd.DataFrame:
        import pandas as pd

        try:
            table = pd.read_parquet(path)
        except Exception as error:
            # pyarrow has errors of many kinds for a file that is not what it says
            raise InputError(f"{path} is no Parquet file or is damaged; remove it") from error
        if table.attrs.pop(_KEY, None) != self.identity:
            raise InputError(f"{path} holds {self.what}; give another path or remove it")
        return table
