"""Parameters that each experiment has for itself, as a table."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def separate_values(parameters: pd.DataFrame, count: int = 0) -> pd.DataFrame:
    """A row for each of ``count`` experiments, a value and its standard error for each such
    parameter; NaN where it is known.
    """
    import pandas as pd

    columns: dict[str, dict[int, float]] = {}
    for name, row in parameters.iterrows():
        found = re.fullmatch(r"(.+)\[(\d+)\]", str(name))
        if found:
            columns.setdefault(found[1], {})[int(found[2])] = row["value"]
            columns.setdefault(f"{found[1]}_std", {})[int(found[2])] = row["std"]
    frame = pd.DataFrame(columns).sort_index()
    if columns:
        frame = frame.reindex(range(max(count, int(frame.index.max()) + 1)))
    frame.index.name = "experiment"
    return frame
