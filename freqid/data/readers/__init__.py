"""Kinds of files: each module of this folder reads one into columns, and may write it.

It may import what stands below ``data``: checks and lti.
"""

import importlib
import pkgutil

# in the order in which errors name their suffixes; a new file of this folder needs no line here
_FIRST = ("text", "parquet", "npz", "mat", "hdf5", "uff")
for _name in dict.fromkeys([*_FIRST, *(file.name for file in pkgutil.iter_modules(__path__))]):
    importlib.import_module(f"{__name__}.{_name}")
