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


def _shown(plant: GreyBox) -> list[object]:
    """A plant's function by what it returns around its values, its parameters as they are."""
    written = model_to_dict(plant)
    shown: list[object] = [written[n] for n in ("parameters", "ties", "conditions", "input_delay")]
    for step in _STEPS:
        moved = {n: v * (1 + step) + step * (v == 0) for n, v in plant.values.items()}
        set_ = {n: v * (1 + step) + step * (v == 0) for n, v in plant.conditions.items()}
        free = [p.name for p in plant.free_parameters]
        try:
            lin = plant.with_conditions(**set_).linearise({**plant.values, **moved}, free)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            # a plant may not exist there
            shown.append(type(error).__name__)
        else:
            shown += [*lin.at, *lin.derivative]
    return shown
