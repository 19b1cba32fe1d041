"""A fingerprint of what was asked, which tells whether finished rows belong to it."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from freqid.models import GreyBox, model_to_dict

# steps of the values and conditions at which a plant's function shows what it is
_STEPS = (0.0, 0.1, -0.07)
# what says of itself all that it is
_PLAIN = (bool, int, float, complex, str, bytes, np.ndarray)


def fingerprint(*things: object) -> str:
    """Of models, options and data by what they hold, files by their size and time."""
    seen = hashlib.sha256()
    for thing in things:
        _add(seen, thing)
    return seen.hexdigest()


def _add(seen: hashlib._Hash, thing: object) -> None:
    seen.update(type(thing).__name__.encode())
    if isinstance(thing, GreyBox):
        _add(seen, _shown(thing))
    elif isinstance(thing, Path):
        stat = thing.stat() if thing.exists() else None
        seen.update(repr((str(thing), stat and (stat.st_size, stat.st_mtime_ns))).encode())
    elif isinstance(thing, np.ndarray):
        seen.update(repr((thing.shape, thing.dtype.str)).encode())
        seen.update(np.ascontiguousarray(thing).tobytes())
    elif dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        own = vars(thing) if hasattr(thing, "__dict__") else {}
        names = [f.name for f in dataclasses.fields(thing)]
        # stamps of a record are no fields of it; what is cached begins with an underscore
        names += [n for n in own if n not in names and not n.startswith("_")]
        _add(seen, {n: getattr(thing, n) for n in names})
    elif isinstance(thing, Mapping):
        for name, value in thing.items():
            _add(seen, name)
            _add(seen, value)
    elif isinstance(thing, Sequence) and not isinstance(thing, str | bytes):
        for value in thing:
            _add(seen, value)
    else:
        seen.update(repr(thing).encode())


def at_conditions(plant: GreyBox, conditions: Sequence[Mapping[str, float]]) -> list[object]:
    """What a plant's function returns at the conditions of the records."""
    known = [*plant.conditions, *plant.values]
    met = {tuple(sorted((n, v) for n, v in c.items() if n in known)) for c in conditions}
    shown: list[object] = []
    for each in sorted(met):
        shown += _returned(plant, dict(each), {})
    return shown


def _shown(plant: GreyBox) -> list[object]:
    """A plant's function by its code and what it returns around its values."""
    written = model_to_dict(plant)
    shown: list[object] = [written[n] for n in ("parameters", "ties", "conditions", "input_delay")]
    shown += _code(plant.matrices)
    for step in _STEPS:
        moved, set_ = (
            {n: v * (1 + step) + step * (v == 0) for n, v in of.items()}
            for of in (plant.values, plant.conditions)
        )
        shown += _returned(plant, set_, moved)
    return shown


def _returned(
    plant: GreyBox, conditions: Mapping[str, float], values: Mapping[str, float]
) -> list[object]:
    try:
        met = plant.with_conditions(**conditions)
        lin = met.linearise({**met.values, **values}, [p.name for p in met.free_parameters])
    except (Exception, SystemExit) as error:
        # a plant may not exist there, and a user's function may raise anything
        return [type(error).__name__]
    return [*lin.at, *lin.derivative]


def _code(function: object, depth: int = 3) -> list[object]:
    """What a function written in Python is: its code and what it closes over, as far as both are
    plain. Objects are left out whose text differs from process to process.
    """
    code = getattr(function, "__code__", None)
    if code is None or not depth:
        return []
    shown: list[object] = [code.co_code, code.co_names]
    shown += [c for c in code.co_consts if isinstance(c, _PLAIN)]
    for cell in getattr(function, "__closure__", None) or ():
        try:
            inside = cell.cell_contents
        except ValueError:
            # a name that is not bound yet
            continue
        shown += [inside] if isinstance(inside, _PLAIN) else _code(inside, depth - 1)
    return shown
