"""Cells of a table that hold no numbers, named so that they can be found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError

if TYPE_CHECKING:
    import pandas as pd


def no_number(frame: pd.DataFrame, names: Sequence[str]) -> InputError:
    """The error for the first cell of columns that is neither a number nor blank."""
    import pandas as pd

    for name in names:
        column = frame[name]
        wrong = column.notna() & pd.to_numeric(column, errors="coerce").isna()
        if wrong.any() and column.dtype.kind not in "fiubc":
            # beside a cell that is none, numbers with decimal commas have stayed texts
            pointed = column.astype(str).str.replace(",", ".", regex=False)
            others = column.notna() & pd.to_numeric(pointed, errors="coerce").isna()
            wrong = others if others.any() else wrong
        if wrong.any():
            row = int(np.argmax(wrong.to_numpy()))
            return InputError(
                f"columns {list(names)} hold values that are not numbers, first "
                f"{frame[name].iloc[row]!r:.60} in row {row} of {name!r}; mend or leave out the row"
            )
    return InputError(f"columns {list(names)} hold values that are not numbers")
