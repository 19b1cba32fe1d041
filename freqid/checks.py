"""Argument checks that every public function shares: each error names the argument and the cure."""

from __future__ import annotations

import difflib
import functools
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

# what an array holds is said by its name here: numpy's own types follow precision too closely, so
# that only the element kind of public results is checked
Array = npt.NDArray[Any]
FloatArray = npt.NDArray[Any]
ComplexArray = npt.NDArray[Any]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]


T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")
# what a pickle keeps of an object
State = dict[str, Any]
# processes that may be asked for; samples that a signal may have: 64 GiB of them
_PROCESSES = 10_000
_MOST = 2**33
# channels of a single sample that are samples of a single channel
_ACROSS = 64


class InputError(ValueError):
    """What was given cannot be used. Caught where another way is tried, so that the errors of
    numpy and scipy, which are ValueErrors too, do not vanish with it.
    """


def positive(name: str, value: object, unit: str = "") -> float:
    """Return ``value`` as a float; ValueError unless it is finite and above zero."""
    number = finite(name, value)
    if number <= 0:
        raise InputError(
            f"{name}={value!r} must be a positive number{f' ({unit})' if unit else ''}"
        )
    return number


def finite(name: str, value: object) -> float:
    """Return ``value`` as a float; ValueError unless it is a finite real number."""
    try:
        # numpy takes a duration for a whole number
        other = isinstance(value, (bool, np.timedelta64))
        if isinstance(value, Real) and not other and math.isfinite(value):
            return float(value)
    except OverflowError:
        raise InputError(f"{name} is beyond the numbers that a computer has, 1.8e308") from None
    raise InputError(f"{name}={value!r:.80} must be a finite real number")


def flag(name: str, value: object) -> bool:
    """The value; ValueError for what is neither true nor false."""
    if isinstance(value, (bool, np.bool_)) or (type(value) is int and value in (0, 1)):
        return bool(value)
    raise InputError(f"{name}={value!r:.80} must be True or False")


def processes(value: object) -> int | None:
    """``n_jobs`` as joblib takes it; ValueError for what is no number of processes."""
    if value is None or (isinstance(value, int) and value != 0 and abs(value) <= _PROCESSES):
        return value
    raise InputError(f"n_jobs={value!r:.80} must be a number of processes, -1 for all, or None")


def numbers(name: str, values: ArrayLike, kind: type = float) -> Array:
    """A new array of ``kind``; ValueError for what is no array of numbers."""
    try:
        return np.array(real(name, values) if kind is float else values, dtype=kind)
    except InputError:
        raise
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}={values!r:.80} must be numbers, or an array of them") from None


def an(name: str, value: object, *kinds: type[T]) -> T:
    """The value; ValueError unless it is of one of the kinds."""
    if isinstance(value, kinds):
        return value
    wanted = " or ".join(kind.__name__ for kind in kinds)
    raise InputError(f"{name} is a {type(value).__name__}; expected a {wanted}")


def listed(name: str, values: Iterable[T]) -> list[T]:
    """The values as a list; ValueError for what has none."""
    try:
        return list(values)
    except TypeError:
        raise InputError(f"{name}={values!r:.80} must be a list") from None


def named_values(name: str, values: Mapping[str, T] | None) -> dict[str, T]:
    """Values by name, none for None; ValueError for what is no dictionary."""
    if values is None:
        return {}
    # a pandas.Series is one, too
    if hasattr(values, "items"):
        return dict(values.items())
    raise InputError(f"{name}={values!r:.80} must be a dictionary, values by name")


def path_of(name: str, value: object) -> Path:
    """The path; ValueError for what cannot be one."""
    if isinstance(value, (str, os.PathLike)) and "\0" not in str(value):
        return Path(value)
    raise InputError(f"{name}={value!r:.80} must be a path, as text or pathlib.Path")


def table_with(table: object, column: str, maker: str) -> None:
    """ValueError unless it is a table with that column, as the function ``maker`` returns."""
    if column not in getattr(table, "columns", ()):
        raise InputError(f"table is a {type(table).__name__}; expected what {maker} returns")


def few_enough(name: str, count: float) -> int:
    """A number of samples; ValueError where they would not fit into any memory."""
    if count > _MOST:
        raise InputError(
            f"{name}: {count:.3g} samples would take {count / 2**27:.3g} GiB of memory; take less"
        )
    return round(count)


def whole(name: str, value: object, least: int = 1, most: float = math.inf) -> int:
    """Return ``value`` as an int; ValueError unless it is whole and from ``least`` to ``most``."""
    try:
        number = finite(name, value)
    except InputError as error:
        told = str(error)
        kind = f", a whole one of at least {least}" if told.endswith("number") else ""
        raise InputError(told + kind) from None
    if not number.is_integer() or number < least:
        raise InputError(f"{name}={value!r} must be a whole number of at least {least}")
    if number > most:
        raise InputError(f"{name}={value!r:.40} must be at most {most:g}")
    return int(number)


def steps(name: str, value: float, dt: float, least: int = 1) -> int:
    """How many times ``dt`` (s) a time is; ValueError unless whole and at least ``least``."""
    count = positive(name, value, "s") / positive("dt", dt, "s")
    number = round(count)
    if number < least or abs(count - number) > 1e-6 * count:
        raise InputError(f"{name}={value:g} s must be a whole number of dt={dt:g} s")
    return number


def real(name: str, values: ArrayLike) -> ArrayLike:
    """The same values; ValueError where some are masked or have an imaginary part."""
    if isinstance(values, np.ma.MaskedArray) and (count := int(np.ma.count_masked(values))):
        raise InputError(
            f"{name} has {count} masked samples; cut the record there or fill them first"
        )
    if np.iscomplexobj(values) and np.any(np.imag(values)):
        raise InputError(f"{name} is complex; expected real numbers: give its real part")
    return np.real(values) if np.iscomplexobj(values) else values


def sealed(state: State) -> State:
    """What a pickle or a copy brought, its arrays read-only as they were."""
    for value in state.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return state


def samples(name: str, values: ArrayLike) -> FloatArray:
    """A read-only copy of signal samples, (N,) or (N, channels), checked to be finite."""
    try:
        array = np.array(real(name, values), dtype=float)
    except InputError:
        raise
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{name} must be an array of real numbers, (N,) or (N, channels)"
        ) from None
    if array.ndim not in (1, 2) or array.size == 0:
        raise InputError(
            f"{name} has shape {array.shape}; expected (N,) or (N, channels) at least one sample"
        )
    if array.ndim == 2 and len(array) == 1 and array.shape[1] > _ACROSS:
        raise InputError(
            f"{name} has shape {array.shape}: {array.shape[1]} channels of one sample; samples go "
            f"down, give {name}.T"
        )
    bad = ~np.isfinite(array)
    if bad.any():
        first = int(np.argwhere(bad)[0, 0])
        raise InputError(
            f"{name} has {int(bad.sum())} NaN or infinite samples, the first in row {first}; "
            "cut the record there with slice() or repair the samples first"
        )
    array.flags.writeable = False
    return array


def choice(name: str, value: object, allowed: Sequence[str], other: str = "") -> str:
    """Return ``value`` if it is one of ``allowed``; ValueError with the nearest name, and what
    ``other`` than a name is taken.
    """
    if isinstance(value, str) and value in allowed:
        return value
    raise InputError(unknown(name, value, allowed) + (f"; or give {other}" if other else ""))


def increasing(name: str, value: FloatArray, unit: str) -> FloatArray:
    """Frequencies (K,) that are finite, not negative and increasing; ValueError for others."""
    asked = f"{name} must be finite, not negative and increasing, (K,), in {unit}"
    if value.ndim != 1 or not len(value):
        raise InputError(f"{asked}; it has shape {value.shape}")
    wrong = ~np.isfinite(value) | (value < 0)
    wrong[1:] |= np.diff(value) <= 0
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(f"{asked}; {name}[{k}]={value[k]:g}")
    return value


def unknown(name: str, value: object, allowed: Iterable[str]) -> str:
    """Sentence for a name that is not among ``allowed``, with the nearest one as a hint."""
    names = [str(a) for a in allowed]
    folded = {n.casefold(): n for n in names}
    near = difflib.get_close_matches(str(value).casefold(), folded, n=1, cutoff=0.5)
    hint = f"; did you mean {folded[near[0]]!r}?" if near else ""
    if not names:
        return f"{name}={value!r} is not there: there are none"
    return f"{name}={value!r} is not one of {', '.join(map(repr, names))}{hint}"


def channel_names(
    argument: str, given: Sequence[str] | None, count: int, letter: str
) -> tuple[str, ...]:
    """Names of ``count`` channels, u or u1, u2, … where none are given; ValueError for others."""
    if given is None:
        return (letter,) if count == 1 else tuple(f"{letter}{i + 1}" for i in range(count))
    names = (given,) if isinstance(given, str) else tuple(listed(argument, given))
    if not all(isinstance(n, str) for n in names):
        raise InputError(f"{argument}={list(names)} must hold names, as text")
    if len(names) != count:
        raise InputError(f"{argument}={list(names)} names {len(names)} of {count} channels")
    return names


def had_elsewhere(**cures: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A function that says of arguments it does not have where they are had, by name."""

    def told(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def checked(*args: P.args, **options: P.kwargs) -> R:
            for name in options:
                if name in cures:
                    raise InputError(f"{name} is no argument of {function.__name__}: {cures[name]}")
            return function(*args, **options)

        return checked

    return told


@contextmanager
def of_data(number: int, count: int) -> Iterator[None]:
    """Errors of one of several data sets say which."""
    try:
        yield
    except InputError as error:
        if count < 2 or str(error).startswith("data["):
            raise
        raise InputError(f"data[{number}]: {error}") from None
