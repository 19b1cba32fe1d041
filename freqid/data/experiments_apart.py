"""Several experiments side by side in one file, each of its own length with its own time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from freqid.data.readers.headings import named

if TYPE_CHECKING:
    import pandas as pd


def of_experiment(frame: pd.DataFrame, *ends: object) -> pd.DataFrame:
    """The experiment that has the channels that are named by ``ends``, the longest where none is,
    with a note of the others.
    """
    apart: list[pd.DataFrame] = frame.attrs.pop("apart", [])
    if not apart:
        return frame
    names = [n for end in ends for n in _texts(end)]
    every = [frame, *apart]
    chosen = next((f for f in every if names and set(names) <= _channels(f)), frame)
    chosen.attrs = {**frame.attrs, "notes": list(frame.attrs.get("notes", []))}
    for other in every:
        if other is not chosen:
            columns = list(map(str, other.columns))
            some = ", ".join(columns[:4]) + (", …" if len(columns) > 4 else "")
            chosen.attrs["notes"].append(
                f"{some}: {len(other)} samples with a time of their own are another experiment, "
                "and left out; name its channels to read it"
            )
    return chosen


def _channels(frame: pd.DataFrame) -> set[str]:
    """Names of its columns, as they stand there and without their units."""
    return {n for c in frame.columns for n in (str(c), named(str(c))[0])}


def _texts(end: object) -> list[str]:
    if isinstance(end, str):
        return [end]
    return [n for n in end if isinstance(n, str)] if isinstance(end, Iterable) else []
