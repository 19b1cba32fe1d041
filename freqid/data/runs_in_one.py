"""Several runs in one table, which are records of their own."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

_NUMBERS = re.compile(
    r"(run|trial|experiment|test|repeat|repetition|episode)s?[ _-]?(id|no|nr|num|number|index)?",
    re.IGNORECASE,
)
# rows that a run has on average, or more
_LONG = 20


def runs_in_one(frame: pd.DataFrame, used: Collection[str]) -> list[str]:
    """A note on a column that numbers the runs of a table, and is none of the channels that are
    ``used``.
    """
    for name in frame.columns:
        if name in used or not _NUMBERS.fullmatch(str(name).strip()):
            continue
        codes, values = frame[name].factorize()
        changes = int(np.count_nonzero(np.diff(codes)))
        # what comes back, or is missing at times, numbers none
        if 0 < changes == len(values) - 1 <= len(frame) / _LONG - 1 and (codes >= 0).all():
            return [
                f"column {name!r} changes {changes} times: {changes + 1} runs are taken as one, of "
                f"which each is a record of its own, as in [Record.from_frame(run, ...) for _, run "
                f"in frame.groupby({name!r})]"
            ]
    return []
