"""PX4 logs, by pyulog (extra ``ulog``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.apart import needs, read_apart
from freqid.data.readers.kinds import Channel, Log, existing, reads_log

_CORRUPT = "parts of the log are damaged and were left out"


@reads_log(".ulg", ".ulog")
def read_ulog(path: Path) -> Log:
    """Every numeric field by topic and field; a topic's later instances as ``topic_1.field``."""
    needs("pyulog", "a PX4 log", "ulog")
    return read_apart("a PX4 log", ulog_channels, existing(path))


def ulog_channels(path: Path) -> Log:
    """What ``read_ulog`` returns, with whatever errors pyulog has."""
    from pyulog import ULog

    log = ULog(str(path))
    found = Log()
    for data in log.data_list:
        if "timestamp" not in data.data:
            continue
        topic = data.name if data.multi_id == 0 else f"{data.name}_{data.multi_id}"
        times = np.asarray(data.data["timestamp"], dtype=float) * 1e-6
        for field, values in data.data.items():
            if field != "timestamp" and values.dtype.kind in "fiub":
                found[f"{topic}.{field}"] = Channel(times, np.asarray(values, dtype=float))
    if not found:
        raise InputError("holds no messages")
    if log.file_corruption:
        found.notes = (_CORRUPT,)
    return found
