"""Names of columns with a unit in brackets behind them, and without."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, overload

from freqid.checks import listed
from freqid.data.readers.headings import is_a_unit, named

if TYPE_CHECKING:
    import pandas as pd


def without_units(
    frame: pd.DataFrame, units: Mapping[str, str], are_units: Callable[[str], bool] = is_a_unit
) -> tuple[pd.DataFrame, dict[str, str]]:
    """Columns without the units in brackets behind their names, and these."""
    told = []
    for column in map(str, frame.columns):
        name, unit = named(column)
        bare = not column.rstrip().endswith(("]", ")")) and are_units is is_a_unit
        told.append((column, "") if bare or (unit and not are_units(unit)) else (name, unit))
    if len({name for name, _ in told}) < len(told) or not any(unit for _, unit in told):
        return frame, dict(units)
    own = {name: unit for name, unit in told if unit}
    return frame.set_axis([name for name, _ in told], axis=1), {**own, **units}


# words of a name that tell which side of the plant a signal is on: letters beside any others, words
# beside those of a plant alone, for the output of a converter or a controller is its input
_LETTERS = "u", "y"
_WORDS = {"in", "input", "inputs"}, {"out", "output", "outputs"}
_PLANT = {"plant", "system", "sys", "process", "data", "signal", "signals"}


def told_sides(names: Sequence[str]) -> tuple[list[str], list[str]] | None:
    """The input and the output where their names say which they are, whatever their order.

    These are ``u`` and ``y`` among others, or of two names one with a word for the input and one
    with a word for the output. None where the names do not tell.

    >>> told_sides(["plant_output", "plant_input"])
    (['plant_input'], ['plant_output'])
    >>> told_sides(["torque", "angle"])
    """
    if set(names) >= {"u", "y"}:
        return ["u"], ["y"]
    if len(names) != 2:
        return None
    sides = [[n for n in names if _is_on(n, side)] for side in (0, 1)]
    return (sides[0], sides[1]) if all(len(side) == 1 for side in sides) else None


def _is_on(name: str, side: int) -> bool:
    """Whether a name says that its signal is on one side of the plant, and not on the other."""
    words = _words(name)
    if words & {*_LETTERS}:
        return words & {*_LETTERS} == {_LETTERS[side]}
    told = words & (_WORDS[0] | _WORDS[1])
    return bool(told) and told <= _WORDS[side] and words - told <= _PLANT


def _words(name: str) -> frozenset[str]:
    """The words of a name, small: of ``motorInput_1`` motor and input."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(re.findall(r"[a-z]+", apart.casefold()))


def listed_by_name(first: str) -> str:
    """What is said where the first channel of a file that sorts them was taken for the input."""
    return (
        "HDF5 lists channels by their names, not as they were written: "
        f"{first!r} was taken for the input, name inputs= and outputs="
    )


@overload
def known(names: str | None, frame: pd.DataFrame, argument: str = ...) -> str | None: ...


@overload
def known(
    names: Sequence[str] | str | None, frame: pd.DataFrame, argument: str = "columns"
) -> Sequence[str] | str | None: ...


def known(
    names: Sequence[str] | str | None, frame: pd.DataFrame, argument: str = "columns"
) -> Sequence[str] | str | None:
    """Columns as the frame calls them: the unit in brackets behind a name may be given or not."""
    if names is None:
        return None
    given = [names] if isinstance(names, str) else listed(argument, names)
    plain = [n if n in frame.columns or named(n)[0] not in frame.columns else named(n)[0]
             for n in given]  # fmt: skip
    return plain[0] if isinstance(names, str) else plain
