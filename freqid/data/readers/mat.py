"""MATLAB files: arrays, or the fields of a structure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import READERS, damaged, of_one_group, reads

if TYPE_CHECKING:
    import pandas as pd


@reads(".mat")
def read_mat(path: Path, group: str | None = None) -> pd.DataFrame:
    """The variables of a MAT file, or the fields of a structure in it, as columns.

    Raises ValueError for a damaged file, or several structures with the same fields.
    """
    import scipy.io
    from scipy.io.matlab import MatReadError

    try:
        content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:
        # version 7.3 is HDF5
        return READERS[".h5"](path, group=group)
    except (ValueError, TypeError, OSError, IndexError, MatReadError) as error:
        raise damaged("a MAT file", error) from None
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
