"""Parameters that each experiment has for itself: a table, and the model that has the first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from freqid.models import GreyBox

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


def with_unknowns(model: GreyBox, names: Sequence[str]) -> tuple[GreyBox, list[int]]:
    """A model that is free in what an estimate has names for, and the places of these among them.

    What conditions made known is fixed; of values that each experiment has for itself the model has
    the first.
    """
    first = {n.split("[")[0]: i for i, n in reversed([*enumerate(names)])}
    free = [p.name for p in model.free_parameters]
    return model.fix(*{*free} - {*first}), [first[n] for n in free if n in first]
