"""Tables of other libraries as pandas frames: polars, pyarrow, xarray, benchmark data sets."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from numbers import Real
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from freqid.checks import Array, InputError

if TYPE_CHECKING:
    import pandas as pd

_EXPECTED = (
    "expected a DataFrame of pandas, polars or another library that narwhals knows, an "
    "xarray.Dataset, or an object with u, y and sampling_time"
)


class Table(NamedTuple):
    """A table in pandas, with what its own library says of it beside the numbers."""

    frame: pd.DataFrame
    units: Mapping[str, str]
    dt: float | None = None
    inputs: list[str] | None = None


def as_pandas(frame: object) -> Table:
    """The same table in pandas.

    Whatever is no table, or one of several dimensions or not in memory, raises ValueError.
    """
    import pandas as pd

    if isinstance(frame, pd.DataFrame):
        if frame.columns.nlevels > 1:
            raise InputError(
                f"frame has columns of {frame.columns.nlevels} levels, as {frame.columns[0]!r}; "
                "give each one name: frame.columns = [...]"
            )
        told = frame.attrs.get("units")
        return Table(_with_dates(frame), dict(told) if isinstance(told, dict) else {})
    # no library is imported for the question whether an object is one of its own
    home = type(frame).__module__.partition(".")[0]
    if home == "xarray":
        return _of_xarray(frame)
    if all(hasattr(frame, name) for name in ("u", "y", "sampling_time")):
        return _of_data_set(frame)
    return Table(_of_columns(frame), {})


def _of_columns(frame: object) -> pd.DataFrame:
    """A table of named columns, column by column, so that no arrow is needed in between."""
    import narwhals as nw
    import pandas as pd

    try:
        table = nw.from_native(frame, eager_only=True)  # type: ignore[call-overload]
    except TypeError:
        kind = type(frame).__name__
        if hasattr(frame, "collect"):
            raise InputError(f"frame is a {kind}; collect it into memory first") from None
        raise InputError(f"frame is a {kind}; {_EXPECTED}") from None
    return pd.DataFrame({name: table[name].to_numpy() for name in table.columns})


def _of_xarray(found: object) -> Table:
    """A data set or array along one dimension, the units of its variables with it."""
    import pandas as pd

    sizes = dict(getattr(found, "sizes", {}))
    if hasattr(found, "data_vars"):
        if len(sizes) != 1:
            raise InputError(f"frame has the dimensions {sizes}; expected one, the time")
        return Table(found.to_dataframe(), _units_of(found))  # type: ignore[attr-defined]
    if hasattr(found, "to_pandas") and len(sizes) == 2:
        frame = pd.DataFrame(found.to_pandas())
        frame.columns = [str(c) for c in frame.columns]
        return Table(frame, _units_of(found))
    raise InputError(
        f"frame is a {type(found).__name__} of the dimensions {sizes}; expected an "
        "xarray.Dataset, or an array of time by channel"
    )


def _units_of(found: object) -> dict[str, str]:
    """Units of xarray's variables, and of the time, which is a coordinate: those of the climate and
    forecast conventions count since a date.
    """
    coords, variables = (getattr(found, of, {}).items() for of in ("coords", "data_vars"))
    at = {str(n): str(v.attrs["units"]).partition(" since ")[0] for n, v in coords
          if "units" in v.attrs}  # fmt: skip
    return at | {str(n): str(v.attrs["units"]) for n, v in variables if "units" in v.attrs}


def _of_data_set(found: object) -> Table:
    """Arrays u and y with a sample time, as nonlinear_benchmarks hands them out."""
    import pandas as pd

    columns: dict[str, Array] = {}
    for name in ("u", "y"):
        values = np.asarray(getattr(found, name))
        if values.ndim not in (1, 2):
            raise InputError(f"frame.{name} has the shape {values.shape}; expected (N,) or (N, n)")
        rows = values.reshape(len(values), -1).T
        names = [name] if len(rows) == 1 else [f"{name}{i + 1}" for i in range(len(rows))]
        columns |= dict(zip(names, rows, strict=True))
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"frame has channels of different lengths, {lengths}")
    step = found.sampling_time  # type: ignore[attr-defined]
    dt = float(step) if isinstance(step, Real) else None
    return Table(pd.DataFrame(columns), {}, dt, [n for n in columns if n.startswith("u")])


def _with_dates(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with an index of Python's dates, or of periods, as one of dates."""
    import pandas as pd

    index = frame.index
    if isinstance(index, pd.PeriodIndex):
        return frame.set_axis(index.to_timestamp())
    if index.dtype == object and len(index) and isinstance(index[0], datetime.datetime):
        return frame.set_axis(pd.DatetimeIndex(index))
    return frame
