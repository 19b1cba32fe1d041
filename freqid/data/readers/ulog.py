"""PX4 logs, by pyulog (extra ``ulog``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.kinds import Channel, damaged, existing, missing, reads_log


@reads_log(".ulg", ".ulog")
def read_ulog(path: Path) -> dict[str, Channel]:
    """Every numeric field by topic and field; a topic's later instances as ``topic_1.field``."""
    try:
        from pyulog import ULog
    except ImportError:
        raise missing("a PX4 log", "pyulog", "ulog") from None
    existing(path)
    try:
        log = ULog(str(path))
    except Exception as error:
        # pyulog has errors of many kinds for a file that is not what it says
        raise damaged("a PX4 log", error) from None
    if not log.data_list:
        raise InputError("holds no messages")
    found = {}
    for data in log.data_list:
        topic = data.name if data.multi_id == 0 else f"{data.name}_{data.multi_id}"
        times = np.asarray(data.data["timestamp"], dtype=float) * 1e-6
        for field, values in data.data.items():
            if field != "timestamp" and values.dtype.kind in "fiub":
                found[f"{topic}.{field}"] = Channel(times, np.asarray(values, dtype=float))
    return found
