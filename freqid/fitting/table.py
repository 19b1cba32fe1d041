"""Tables of estimates: DataFrames with all digits, which show those that their errors leave.

pandas is imported with this module, and this module where a table is made.
"""

from __future__ import annotations

import pandas as pd

from freqid.fitting.digits import in_digits, in_pairs


class Table(pd.DataFrame):
    """Values with their errors; a part of it is a plain DataFrame."""

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        return pd.DataFrame

    def _shown(self) -> pd.DataFrame:
        return in_digits(self) if "std" in self.columns else in_pairs(self)

    def __repr__(self) -> str:
        return self._shown().to_string()

    def _repr_html_(self) -> str:
        return str(self._shown().to_html())
