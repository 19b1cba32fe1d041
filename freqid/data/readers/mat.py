"""MATLAB files: arrays, or the fields of a structure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import READERS, damaged, of_one_group, reads
from freqid.data.readers.mat_structure import check_structure

if TYPE_CHECKING:
    import pandas as pd


@reads(".mat")
def read_mat(path: Path, group: str | None = None) -> pd.DataFrame:
    """The variables of a MAT file, or the fields of a structure in it, as columns.

    Raises ValueError for a damaged file, or several structures with the same fields.
    """
    try:
        content = loaded(path)
    except NotImplementedError:
        # version 7.3 is HDF5
        return READERS[".h5"](path, group=group)
    found: dict[str, dict[str, Any]] = {}
    for name, value in content.items():
        if name.startswith("__"):
            continue
        fields = getattr(getattr(value, "dtype", None), "names", None)
        if fields and np.ndim(value) == 0:
            found[name] = {field: value[field].item() for field in fields}
        else:
            found.setdefault("", {})[name] = value
    return columns_of(of_one_group(found, group, "structure"))


def loaded(path: Path) -> dict[str, Any]:
    """The variables of a MAT file by name; ValueError for a damaged one.

    Raises NotImplementedError for version 7.3.
    """
    import scipy.io

    check_structure(path)
    try:
        return scipy.io.loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:
        raise
    except Exception as error:
        # scipy has errors of many kinds for a file that is not what it says
        raise damaged("a MAT file", error) from None
