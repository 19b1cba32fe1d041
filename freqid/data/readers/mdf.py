"""MDF4, the format of measurement in vehicles, by asammdf (extra ``mdf``)."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.kinds import Channel, damaged, existing, missing, reads_log


def _collected() -> None:
    """What asammdf has made of a damaged file complains when it is collected: not to the user."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda unraisable: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = hook


@reads_log(".mf4", ".mdf", ".dat4")
def read_mdf(path: Path) -> dict[str, Channel]:
    """Every numeric channel by name; of names that come twice the later is ``name_1``."""
    try:
        from asammdf import MDF
    except ImportError:
        raise missing("MDF4", "asammdf", "mdf") from None
    existing(path)
    found: dict[str, Channel] = {}
    try:
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
                found[name] = Channel(times, values.astype(float), str(signal.unit or ""))
        problem = None
    except Exception as error:
        # asammdf has errors of many kinds for a file that is not what it says
        problem = damaged("MDF4", error)
    if problem is not None:
        _collected()
        raise problem
    if not found:
        raise InputError("holds no numeric channels")
    return found
