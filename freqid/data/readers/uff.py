"""Universal files: time responses of data sets 58, by pyuff (extra ``uff``)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from freqid.checks import Array, InputError
from freqid.data.readers.apart import needs, read_apart
from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import ResponseFile, existing, reads

if TYPE_CHECKING:
    import pandas as pd


# a data set as pyuff gives it, by the names of its fields
DataSet: TypeAlias = dict[str, Any]
# what stands for no unit
_NO_UNIT = {"", "NONE", "UNKNOWN"}
# part of the length by which the times of two channels may differ by rounding
_AGREE = 1e-6


def data_sets(path: Path) -> list[DataSet]:
    """All data sets of a universal file, as pyuff calls what is in them."""
    needs("pyuff", "UFF58", "uff")
    return read_apart("UFF58", pyuff_sets, existing(path))


def pyuff_sets(path: Path) -> list[DataSet]:
    """What ``data_sets`` returns, with whatever errors pyuff has."""
    import pyuff

    sets = pyuff.UFF(str(path)).read_sets()
    sets = [sets] if isinstance(sets, dict) else list(sets)
    for number, s in enumerate(sets, 1):
        # values would be taken for those of other times or frequencies
        if s.get("type") == 58 and s["num_pts"] != len(s["data"]):
            raise InputError(
                f"is cut: data set {number} says {s['num_pts']} values and holds {len(s['data'])}"
            )
    return sets


@reads(".uff", ".unv")
def read_uff(path: Path) -> pd.DataFrame:
    """The time responses of a UFF as columns; ValueError for none of them, or without pyuff."""
    sets = data_sets(path)
    arrays: dict[str, Array] = {}
    units: dict[str, str] = {}
    for number, s in enumerate(sets):
        if s.get("type") != 58 or s.get("func_type") != 1:
            continue
        name = str(s.get("id1") or s.get("rsp_ent_name") or "").strip()
        if not name or name.upper() == "NONE":
            name = f"channel{number + 1}"
        if name in arrays:
            raise InputError(f"holds two channels called {name!r}; rename one of them")
        arrays[name] = np.real(s["data"])
        if (unit := str(s.get("ordinate_axis_units_lab") or "").strip()).upper() not in _NO_UNIT:
            units[name] = unit
        times = arrays.setdefault("time", np.asarray(s["x"], dtype=float))
        own = np.asarray(s["x"], dtype=float)
        if own.shape != times.shape or np.abs(own - times).max() > _AGREE * np.ptp(times):
            raise InputError(
                f"holds {name!r} at times of its own; its channels must share one, or be read by "
                "pyuff and given to Record.from_logs"
            )
    if not arrays:
        others = any(s.get("type") == 58 and s.get("func_type") == 4 for s in sets)
        if others:
            raise ResponseFile
        raise InputError("holds no time responses (data sets 58 of function type 1)")
    unit = str(
        next(s for s in sets if s.get("func_type") == 1).get("abscissa_axis_units_lab") or ""
    )
    if unit.strip().upper() not in _NO_UNIT:
        units["time"] = unit.strip()
    return columns_of({f"{n} [{units[n]}]" if n in units else n: x for n, x in arrays.items()})
