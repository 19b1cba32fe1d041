"""Parquet, by pyarrow (extra ``parquet``)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from freqid.checks import InputError
from freqid.data.readers.columns import text_of, unit_of
from freqid.data.readers.kinds import damaged, missing, reads, writes
from freqid.data.readers.limits import check_size
from freqid.data.readers.parquet_structure import check_pages

if TYPE_CHECKING:
    import pandas as pd


@reads(".parquet")
def read_parquet(path: Path) -> pd.DataFrame:
    """The columns of a Parquet file; ValueError for a damaged one, or without pyarrow."""
    import pandas as pd

    try:
        import pyarrow.parquet

        check_pages(path)
        layout = pyarrow.parquet.read_metadata(path)
        check_size(path, 8.0 * layout.num_rows * layout.num_columns)
        frame = pd.read_parquet(path)
        frame = frame if frame.index.name in (None, "time") else frame.reset_index()
        if not frame.columns.is_unique:
            twice = frame.columns[frame.columns.duplicated()][0]
            raise InputError(f"holds column {twice!r} twice; names must differ")
        # units that stand beside names, which may have some of their own
        frame.attrs["beside"] = field_units(pyarrow.parquet.read_schema(path))
        return frame
    except InputError:
        raise
    except ImportError:
        raise missing("Parquet", "pyarrow", "parquet") from None
    except Exception as error:
        # pyarrow has errors of many kinds for a file that is not what it says
        raise damaged("Parquet", error) from None


def field_units(schema: Any) -> dict[str, str]:
    """Units by name that the fields of an Arrow schema tell as ``unit`` or ``units``."""
    told = {
        str(field.name): unit_of({text_of(k): v for k, v in (field.metadata or {}).items()})
        for field in schema
    }
    return {name: unit for name, unit in told.items() if unit}


@writes(".parquet")
def write_parquet(frame: pd.DataFrame, path: Path) -> None:
    """The frame with its time as a column; ValueError without pyarrow."""
    try:
        frame.reset_index().to_parquet(path, index=False)
    except ImportError:
        raise InputError("Parquet needs pyarrow: pip install 'freqid[parquet]'") from None
