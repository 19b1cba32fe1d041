"""The table of ``residual_test``: a DataFrame that draws its correlations.

pandas is imported with this module, and this module where a table is made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from freqid.plots import Panels


class ResidualTable(pd.DataFrame):
    """Tests of what a model leaves, with their correlations in ``attrs``."""

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        # a part of the table is no such table any more
        return pd.DataFrame

    def plot(  # type: ignore[override]
        self, ax: Panels | None = None, backend: str = "matplotlib"
    ) -> Panels:
        """Correlations with their limits; see ``freqid.plot_residuals``."""
        from freqid.plots import plot_residuals

        return plot_residuals(self, ax=ax, backend=backend)  # type: ignore[arg-type]
