"""MATLAB files: arrays, or the fields of a structure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import READERS, damaged, reads

if TYPE_CHECKING:
    import pandas as pd


@reads(".mat")
def read_mat(path: Path) -> pd.DataFrame:
    """The variables of a MAT file as columns; ValueError for a damaged one."""
    import scipy.io
    from scipy.io.matlab import MatReadError

    try:
        content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:
        # version 7.3 is HDF5
        return READERS[".h5"](path)
    except (ValueError, TypeError, OSError, IndexError, MatReadError) as error:
        raise damaged("a MAT file", error) from None
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
