"""Structures that MATLAB's tools log in: blocks of Simulink, recorders of dSPACE, series in time.

Formats: Simulink, "To Workspace", structure with time (time, signals.values, signals.label);
dSPACE ControlDesk, recordings as MAT files (X and Y, each with Name, Data and Unit); the System
Identification Toolbox, the properties of iddata (InputData, OutputData, their names and units).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from freqid.checks import Array, InputError
from freqid.data.time_names import time_named

# a structure's fields by name, whatever they hold
Fields: TypeAlias = "dict[str, Any]"

# what a series in time calls its samples, where they are all that it holds
_SAMPLES = ("data", "values", "value")
# structures of an array that are looked at
_MOST = 1000
# numbers that may be samples
_FEWEST = 16


@dataclass(eq=False)
class Group:
    """Arrays of one structure by name, and their units; of a series in time the name of its
    ``samples``.
    """

    arrays: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    samples: str | None = None

    @property
    def has_samples(self) -> bool:
        """Whether any of the arrays may be a channel."""
        return bool(_long(self.arrays))

    def samples_alone(self) -> Group:
        """The same without what is no channel, structures within for one."""
        arrays = {name: self.arrays[name] for name in _long(self.arrays)}
        return dataclasses.replace(self, arrays=arrays)

    @property
    def has_channels(self) -> bool:
        """Whether any of them is more than a time."""
        return any(time_named([name]) is None for name in _long(self.arrays))


def structure_of(value: object) -> Fields | None:
    """The fields of a structure; None for anything else, several structures in an array too."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if not names or np.ndim(value) != 0:  # type: ignore[arg-type]
        return None
    record = np.asarray(value)
    return {name: record[name].item() for name in names}


def one_by_one(content: Mapping[str, object]) -> dict[str, object]:
    """Structures of an array as MATLAB calls them, ``runs(1)``, ``runs(2)``; others as they are."""
    found: dict[str, object] = {}
    for name, value in content.items():
        array = np.asarray(value) if getattr(value, "dtype", None) is not None else None
        if array is None or not array.dtype.names or array.ndim == 0 or array.size > _MOST:
            found[name] = value
            continue
        each = {f"{name}({i + 1})": one for i, one in enumerate(array.ravel(order="F"))}
        # numbers and words beside the samples are no experiments
        fields = [x for one in each.values() for x in (structure_of(one) or {}).values()]
        sampled = any(np.size(x) > _FEWEST for x in fields)
        found |= each if sampled else {name: value}
    return found


def group_of(name: str, fields: Fields) -> Group:
    """What the structure called ``name`` holds, whichever tool has written it."""
    if read := _tool_of(fields):
        return read(name.rpartition("/")[2], fields)
    others = [n for n in _long(fields) if n.lower() != "time"]
    alone = len(others) == 1 < len(_long(fields)) and others[0].lower() in _SAMPLES
    return Group(dict(fields), samples=others[0] if alone else None)


def _tool_of(fields: Fields) -> Callable[[str, Fields], Group] | None:
    """What reads a structure that a tool has written, all of it; None for any other."""
    if _entries(fields.get("signals"), "values"):
        return _simulink
    if _entries(fields.get("Y"), "Data") and _entries(fields.get("X"), "Data"):
        return _dspace
    if all(_is_numeric(fields.get(n, "")) for n in ("InputData", "OutputData")):
        return _iddata
    return None


def told_apart(groups: Mapping[str, Group]) -> dict[str, Group]:
    """Several series in time, whose samples are all called alike, by the names of their structures;
    other groups, and one series, as they are.
    """
    series = [name for name, group in groups.items() if group.samples]
    if len(series) < 2:
        return dict(groups)
    found = dict(groups)
    for name in series:
        own, arrays = groups[name].samples, groups[name].arrays
        leaf = name.rpartition("/")[2]
        found[name] = Group({leaf if n == own else n: arrays[n] for n in _long(arrays)})
    return found


def with_one_time(arrays: Mapping[str, object]) -> dict[str, object]:
    """The same without times that are another one once more, as ``tout`` may be."""
    kept: dict[str, object] = {}
    times: list[Array] = []
    long = _long(arrays)
    for name, values in arrays.items():
        if name in long and time_named([name]) is not None:
            own = np.ravel(np.asarray(values))
            if any(np.array_equal(own, other) for other in times):
                continue
            times.append(own)
        kept[name] = values
    return kept


def _long(arrays: Mapping[str, object]) -> list[str]:
    """Names of what may be a channel."""
    return [n for n, x in arrays.items() if np.asarray(x).size > 1 and _is_numeric(x)]


def inner_groups(name: str, fields: Fields) -> Iterator[tuple[str, Group]]:
    """Structures within a structure, by their paths."""
    if _tool_of(fields):
        return
    for inner, value in fields.items():
        path = f"{name}/{inner}"
        if (deeper := structure_of(value)) is not None:
            yield path, group_of(path, deeper)
            yield from inner_groups(path, deeper)


def _simulink(name: str, fields: Fields) -> Group:
    """Signals of a block, by their labels or else by the structure's name and their number."""
    group = Group()
    signals = _entries(fields["signals"], "values")
    if np.size(fields.get("time", ())):
        group.arrays["time"] = fields["time"]
    for i, signal in enumerate(signals, start=1):
        values = np.asarray(signal["values"])
        # matrices stand behind each other
        values = values.reshape(-1, values.shape[-1]).T if values.ndim == 3 else values
        labels = [str(label).strip() for label in np.ravel(signal.get("label", ""))]
        if values.ndim == 2 and 1 < len(labels) == min(values.shape):
            rows = values if values.shape[0] == len(labels) else values.T
            for label, row in zip(labels, rows, strict=True):
                _add(group, label or f"{name}{i}", row)
            continue
        alone = name if len(signals) == 1 else f"{name}{i}_" if values.ndim == 2 else f"{name}{i}"
        _add(group, (labels[0] if len(labels) == 1 else "") or alone, values)
    return group


def _dspace(name: str, fields: Fields) -> Group:
    """Signals of a recording, by their names, with their units and their time."""
    group = Group()
    axes, signals = _entries(fields["X"], "Data"), _entries(fields["Y"], "Data")
    times = [np.ravel(axes[_number(signal, len(axes)) - 1]["Data"]) for signal in signals]
    if not all(_is_numeric(t) and np.array_equal(t, times[0]) for t in times):
        raise InputError(
            f"recording {name!r} holds signals of several rasters; export those of one"
        )
    group.arrays["time"] = times[0]
    if unit := str(axes[_number(signals[0], len(axes)) - 1].get("Unit", "")).strip():
        group.units["time"] = unit
    for i, signal in enumerate(signals, start=1):
        label = str(signal.get("Name", "")).replace('"', "").strip() or f"{name}{i}"
        unit = str(signal.get("Unit", "")).strip()
        added = _add(group, label, signal["Data"])
        # as ControlDesk writes that there is none
        if unit and unit not in ("-", "[]"):
            group.units[added] = unit
    return group


def _iddata(name: str, fields: Fields) -> Group:
    """Inputs and outputs of measured data by their names, u and y where they have none."""
    group, samples = Group(), 0
    for side, plain in (("Input", "u"), ("Output", "y")):
        data = np.asarray(fields[f"{side}Data"])
        rows = np.atleast_2d(data if data.ndim == 1 or data.shape[0] <= data.shape[1] else data.T)
        names, units = (_words(fields.get(f"{side}{what}"), len(rows)) for what in ("Name", "Unit"))
        for i, (own, unit, row) in enumerate(zip(names, units, rows, strict=True), start=1):
            added = _add(group, own or (plain if len(rows) == 1 else f"{plain}{i}"), row)
            samples = len(row)
            if unit:
                group.units[added] = unit
    step, start = (np.ravel(fields.get(n, ())) for n in ("Ts", "Tstart"))
    if step.size == 1 and _is_numeric(step):
        begin = float(start[0]) if start.size == 1 and _is_numeric(start) else 0.0
        group.arrays["time"] = begin + float(step[0]) * np.arange(samples)
    elif np.size(instants := fields.get("SamplingInstants", ())) == samples:
        group.arrays["time"] = np.ravel(instants)
    if unit := _words(fields.get("TimeUnit"), 1)[0]:
        group.units["time"] = unit
    return group


def _words(told: object, count: int) -> list[str]:
    """So many texts, empty ones where others are told."""
    words = [str(word).strip() for word in np.ravel(np.asarray(told))] if told is not None else []
    return words if len(words) == count else [""] * count


def _number(signal: Fields, most: int) -> int:
    """Which of the axes is a signal's own, the first where that is not told."""
    told = np.ravel(signal.get("XIndex", 1))
    number = told[0] if told.size and _is_numeric(told) else 1
    return int(number) if 1 <= number <= most else 1


def _add(group: Group, label: str, values: Array) -> str:
    """The name under which values are kept: the label, numbered where it came before."""
    known, name = 1, label
    while name in group.arrays:
        known += 1
        name = f"{label}_{known}"
    group.arrays[name] = values
    return name


def _entries(value: object, needed: str) -> list[Fields]:
    """The structures of an array of them, or the only one; none unless all have such a field."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if not names or needed not in names:
        return []
    entries = np.atleast_1d(np.asarray(value)).ravel()
    return [{n: _bare(entry[n]) for n in names} for entry in entries]


def _bare(value: object) -> object:
    """What an array of one object holds; anything else as it is."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim == 0:
        return value.item()
    return value


def _is_numeric(value: object) -> bool:
    return np.asarray(value).dtype.kind in "fiubc"
