"""The table of ``residual_test``: a DataFrame that draws its correlations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from freqid.plots import Panels


def residual_table(rows: Sequence[dict[str, object]]) -> pd.DataFrame:
    """The rows as a DataFrame whose ``plot`` is that of ``freqid.plot_residuals``.

    The class is made here, so that pandas is imported where a table is.
    """
    import pandas as pd

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

    return ResidualTable(list(rows))
