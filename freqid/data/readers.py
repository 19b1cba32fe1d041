"""Files of every kind as frames of columns: CSV, Parquet, MATLAB, numpy, HDF5 and UFF58."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import Array, InputError

if TYPE_CHECKING:
    import pandas as pd


def _csv(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        frame = pd.read_csv(path)
    except pd.errors.EmptyDataError:
        raise InputError("holds no columns; expected samples under a line of names") from None
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        first = str(error).splitlines()[0]
        raise InputError(f"is not CSV or is damaged ({first})") from None
    if len(frame) == 0:
        raise InputError("holds names but no samples")
    return frame


def _parquet(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        return pd.read_parquet(path)
    except ImportError:
        raise InputError("is Parquet, which needs pyarrow: pip install 'freqid[parquet]'") from None
    except Exception as error:
        # pyarrow has errors of many kinds for a file that is not what it says
        raise InputError(f"is not Parquet or is damaged ({_first_line(error)})") from None


def _npz(path: Path) -> pd.DataFrame:
    try:
        # a pickle inside could run anything
        with np.load(path, allow_pickle=False) as arrays:
            return columns_of({name: arrays[name] for name in arrays.files})
    except (OSError, ValueError) as error:
        raise InputError(f"is not an NPZ of plain arrays ({_first_line(error)})") from None


def _mat(path: Path) -> pd.DataFrame:
    import scipy.io

    try:
        content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:
        # version 7.3 is HDF5
        return _hdf5(path)
    except (ValueError, TypeError, OSError, IndexError) as error:
        raise InputError(f"is not a MAT file or is damaged ({_first_line(error)})") from None
    arrays: dict[str, Any] = {}
    for name, value in content.items():
        if name.startswith("__"):
            continue
        fields = getattr(getattr(value, "dtype", None), "names", None)
        if fields and np.ndim(value) == 0:
            arrays |= {field: value[field].item() for field in fields}
        else:
            arrays[name] = value
    return columns_of(arrays)


def _hdf5(path: Path) -> pd.DataFrame:
    try:
        import h5py
    except ImportError:
        raise InputError("is HDF5, which needs h5py: pip install 'freqid[hdf5]'") from None
    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and not name.startswith("#"):
            found[name.rsplit("/", 1)[-1]] = item[()]

    try:
        with h5py.File(path, "r") as file:
            file.visititems(keep)
    except OSError as error:
        raise InputError(f"is not HDF5 or is damaged ({_first_line(error)})") from None
    return columns_of(found)


def _uff(path: Path) -> pd.DataFrame:
    try:
        import pyuff
    except ImportError:
        raise InputError("is UFF58, which needs pyuff: pip install 'freqid[uff]'") from None
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except Exception as error:
        raise InputError(f"is not UFF58 or is damaged ({_first_line(error)})") from None
    sets = [sets] if isinstance(sets, dict) else list(sets)
    arrays: dict[str, Any] = {}
    for number, s in enumerate(sets):
        if s.get("type") != 58 or s.get("func_type") != 1:
            continue
        name = str(s.get("id1") or s.get("rsp_ent_name") or "").strip()
        if not name or name.upper() == "NONE":
            name = f"channel{number + 1}"
        arrays[name] = np.real(s["data"])
        arrays.setdefault("time", np.asarray(s["x"]))
    if not arrays:
        raise InputError("holds no time responses (data sets 58 of function type 1)")
    return columns_of(arrays)


def columns_of(arrays: Mapping[str, Any]) -> pd.DataFrame:
    """Named arrays as columns: matrices become name1, name2, …, scalars are left out.

    The longest arrays are the samples; shorter ones whose length divides it are slow outputs, with
    blanks between. A scalar ``dt`` and no time makes one. Raises ValueError where nothing fits.
    """
    import pandas as pd

    columns: dict[str, Array] = {}
    scalars: dict[str, float] = {}
    for name, value in arrays.items():
        try:
            x = np.squeeze(np.asarray(value, dtype=float))
        except (TypeError, ValueError):
            continue
        if x.ndim == 0:
            scalars[name] = float(x)
        elif x.ndim == 1:
            columns[name] = x
        elif x.ndim == 2:
            x = x if x.shape[0] >= x.shape[1] else x.T
            columns |= {f"{name}{i + 1}": x[:, i] for i in range(x.shape[1])}
    if not columns:
        raise InputError("holds no arrays of samples")
    N = max(len(x) for x in columns.values())
    full: dict[str, Array] = {}
    for name, x in columns.items():
        if len(x) == N:
            full[name] = x
        elif len(x) > 1 and N % len(x) == 0 and name != "time":
            full[name] = np.full(N, np.nan)
            full[name][:: N // len(x)] = x
        else:
            raise InputError(f"array {name!r} has {len(x)} samples beside {N}; lengths must agree")
    if "time" not in full and "t" in full:
        full["time"] = full.pop("t")
    step = scalars.get("dt", scalars.get("Ts"))
    if "time" not in full and step is not None:
        full["time"] = step * np.arange(N)
    return pd.DataFrame(full)


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


READERS: dict[str, Callable[[Path], Any]] = {
    ".csv": _csv,
    ".parquet": _parquet,
    ".npz": _npz,
    ".mat": _mat,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".uff": _uff,
    ".unv": _uff,
}
