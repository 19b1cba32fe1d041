"""How many digits of a number mean something: those down to the second of its standard error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

# digits of a number whose error is not known, and of any at the most
_PLAIN, _MOST = 6, 15


def rounded(value: float, std: float) -> str:
    """A value to the second digit of its standard error; six digits where that is none.

    >>> rounded(1.00461, 0.0123), rounded(143.21, 0.0), rounded(149997.3, 2100.0)
    ('1.005', '143.21', '150000')
    """
    if not (np.isfinite(value) and np.isfinite(std) and std > 0) or value == 0:
        return f"{value:.{_PLAIN}g}"
    # of the error as it is shown: 0.0996 is 0.10
    place = int(np.floor(np.log10(float(f"{std:.2g}")))) - 1
    digits = int(np.clip(int(np.floor(np.log10(abs(value)))) - place + 1, 1, _MOST))
    exact = float(f"{value:.{digits}g}")
    if place >= 0 and abs(exact) < 10**_PLAIN:
        return f"{exact:.0f}"
    # trailing zeros are digits, too
    text = f"{value:#.{digits}g}"
    return text.replace(".e", "e") if "e" in text else text.rstrip(".")


def of_error(std: float) -> str:
    """A standard error in its two digits.

    >>> of_error(0.012345), of_error(361.2), of_error(0.2), of_error(6e-6)
    ('0.012', '360', '0.20', '6.0e-06')
    """
    if not std or not np.isfinite(std):
        return f"{std:g}"
    exact = float(f"{std:.2g}")
    if 100 <= abs(exact) < 10**_PLAIN:
        return f"{exact:.0f}"
    # a zero that is known is a digit, too
    return f"{std:#.2g}".rstrip(".")


def in_digits(table: pd.DataFrame, columns: Sequence[str] = ("lower", "upper")) -> pd.DataFrame:
    """A table of values with their ``std`` as text: ends of intervals as the values themselves."""
    import pandas as pd

    shown: dict[str, list[str]] = {}
    for name in table.columns:
        if name == "value" or name in columns:
            cells = zip(table[name], table["std"], strict=True)
            shown[str(name)] = [rounded(v, s) for v, s in cells]
        elif name == "std":
            shown["±"] = [of_error(s) for s in table["std"]]
        else:
            plain = table[name].map(lambda v: f"{v:.6g}" if isinstance(v, float) else str(v))
            shown[str(name)] = plain.tolist()
    return pd.DataFrame(shown, index=table.index).replace("nan", "")


def in_pairs(table: pd.DataFrame) -> pd.DataFrame:
    """A table whose columns have errors of their own, ``damping`` and ``damping_std``, as text."""
    import pandas as pd

    shown: dict[str, list[str]] = {}
    for name in map(str, table.columns):
        if f"{name}_std" in table.columns:
            cells = zip(table[name], table[f"{name}_std"], strict=True)
            shown[name] = [rounded(v, s) for v, s in cells]
        elif name.endswith("_std"):
            shown[f"± {name.removesuffix('_std')}"] = [of_error(s) for s in table[name]]
        else:
            shown[name] = [str(v) for v in table[name]]
    return pd.DataFrame(shown, index=table.index).replace("nan", "")
