"""MDF4, the format of measurement in vehicles, by asammdf (extra ``mdf``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.apart import needs, read_apart
from freqid.data.readers.kinds import Channel, Log, existing, reads_log


@reads_log(".mf4", ".mdf", ".dat4")
def read_mdf(path: Path) -> Log:
    """Every numeric channel by name; of names that come twice the later is ``name_1``."""
    needs("asammdf", "MDF4", "mdf")
    return read_apart("MDF4", mdf_channels, existing(path))


def mdf_channels(path: Path) -> Log:
    """What ``read_mdf`` returns, with whatever errors asammdf has."""
    from asammdf import MDF
    from asammdf.blocks import v2_v3_blocks, v4_blocks

    # what numexpr does not take would be run as Python, by sympy, or else leave the raw values
    for blocks in (v2_v3_blocks, v4_blocks):
        vars(blocks).update(symbols=str, lambdify=_refused)
    found = Log()
    with MDF(path) as file:
        for signal in file.iter_channels(skip_master=True):
            values = np.asarray(signal.samples)
            if values.ndim != 1 or values.dtype.kind not in "fiub" or not len(values):
                continue
            name, again = signal.name, 0
            while name in found:
                again += 1
                name = f"{signal.name}_{again}"
            times = np.asarray(signal.timestamps, dtype=float)
            if signal.invalidation_bits is not None:
                valid = ~np.asarray(signal.invalidation_bits, dtype=bool)
                if not valid.all():
                    lost = f"{(~valid).sum()} samples of {name!r} are marked as invalid: left out"
                    found.notes = (*found.notes, lost)
                    times, values = times[valid], values[valid]
            found[name] = Channel(times, values.astype(float), str(signal.unit or ""))
    if not found:
        raise InputError("holds no numeric channels")
    return found


def _refused(_: object, formula: str, **options: object) -> None:
    raise InputError(f"the formula {formula!r:.60} of a channel is no arithmetic of its values")
