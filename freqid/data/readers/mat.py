"""MATLAB files: arrays, or the fields of a structure."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import READERS, damaged, of_one_group, reads
from freqid.data.readers.mat_forms import (
    Fields,
    Group,
    group_of,
    inner_groups,
    one_by_one,
    structure_of,
    told_apart,
    with_one_time,
)
from freqid.data.readers.mat_structure import check_structure

if TYPE_CHECKING:
    import pandas as pd


@reads(".mat")
def read_mat(path: Path, group: str | None = None) -> pd.DataFrame:
    """The variables of a MAT file, or the fields of a structure in it, as columns.

    Raises ValueError for a damaged file, several structures with the same fields, or objects alone.
    """
    try:
        content = loaded(path)
    except NotImplementedError:
        # version 7.3 is HDF5
        return READERS[".h5"](path, group=group)
    found: dict[str, Group] = {}
    inner: dict[str, Group] = {}
    objects = _objects(content)
    for name, value in one_by_one(content).items():
        if name.startswith("__") or name in objects:
            continue
        if (fields := structure_of(value)) is not None:
            found[name] = group_of(name, fields)
            inner |= inner_groups(name, fields)
        else:
            found.setdefault("", Group()).arrays[name] = value
    if not any(each.has_channels for each in found.values()):
        # what lies deeper tells something only where nothing but a time does above
        found = {n: g.samples_alone() for n, g in (found | inner).items() if g.has_samples} or found
    found = told_apart(found)
    told = ", ".join(sorted(objects.values()))
    if objects and not any(each.has_samples for each in found.values()):
        raise InputError(
            f"holds objects that MATLAB alone opens ({told}); save their numbers there, as in "
            "t = x.Time; y = x.Data"
        )
    arrays = of_one_group({n: g.arrays for n, g in found.items()}, group, "structure")
    frame = columns_of(with_one_time(arrays))
    units = {name: unit for each in found.values() for name, unit in each.units.items()}
    frame.attrs["units"] = {name: unit for name, unit in units.items() if name in frame.columns}
    if objects:
        frame.attrs["notes"] += [f"objects that MATLAB alone opens are left out: {told}"]
    return frame


def _objects(content: Fields) -> dict[str, str]:
    """Objects among the variables, by key, each with its name and class: ``out (timeseries)``."""
    from scipy.io.matlab import MatlabObject, MatlabOpaque

    found: dict[str, str] = {}
    for name, value in content.items():
        if isinstance(value, MatlabObject):
            found[name] = f"{name} ({value.classname})"
        elif isinstance(value, MatlabOpaque) and not name.startswith("__"):
            entry, parts = np.ravel(value)[0], value.dtype.names or ()
            # its class stands within, and before scipy 1.18 its name as well
            own = _text(entry["s0"]) if "s0" in parts else name
            kind = next(
                (_text(entry[part]) for part in ("_Class", "s2") if part in parts), "object"
            )
            found[name] = f"{own} ({kind})"
    return found


def _text(told: object) -> str:
    return told.decode("latin-1") if isinstance(told, bytes) else str(told)


def loaded(path: Path) -> Fields:
    """The variables of a MAT file by name; ValueError for a damaged one.

    Raises NotImplementedError for version 7.3.
    """
    import scipy.io

    check_structure(path)
    try:
        with warnings.catch_warnings():
            # before scipy 1.18 all objects have one name
            warnings.filterwarnings("ignore", 'Duplicate variable name "None"')
            return scipy.io.loadmat(path, squeeze_me=True, struct_as_record=True, spmatrix=False)
    except NotImplementedError:
        raise
    except Exception as error:
        # scipy has errors of many kinds for a file that is not what it says
        raise damaged("a MAT file", error) from None
