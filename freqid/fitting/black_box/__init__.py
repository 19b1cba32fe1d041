"""Fits of black boxes: subspaces, rational functions on the lines, charts of state spaces.

It may import the rest of fitting but witness, grey_box, hold_tests, order_selection and entry.
"""

import importlib
import pkgutil

# every file here is read, so that a new estimator needs no line elsewhere to be known to fit
for _file in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_file.name}")
