"""ROS 1 and 2 bags and MCAP, by rosbags (extra ``ros``)."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.apart import needs, read_apart
from freqid.data.readers.kinds import Channel, Log, reads_log

# entries of an array that become channels of their own
_LONGEST = 64
_ENTRY = re.compile(r"(.*)\[(\d+)\]()")
_WITHIN = re.compile(r"([^\[\]]+)\[(\d+)\](.*)")
# what a message calls the entries of its arrays, behind the array of which they are where it is one
# alone; or the frames that all of it is about, of which so many are no names
Names: TypeAlias = tuple[str, ...]
_ABOUT, _MANY = "about", 16
# ns, and from where on a time is one since 1970
_SECOND, _CALENDAR = 10**9, 10**17


@reads_log(".bag", ".mcap", ".db3")
def read_bag(path: Path) -> Log:
    """Every number of every message by topic and field, ``joint_states.velocity[2]``.

    Where the messages of a topic name their entries, and not all the same, as several publishers
    do, entries are those of a name: ``joint_states.velocity[shoulder]``, ``tf.transforms[base]``;
    and messages of several frames are of each: ``force[left].wrench.force.x``.

    Times are those of the messages' headers, where they have one, and else those of the log; in s,
    of a clock that counts from 1970 from a whole second before the first, as a float has no digits
    for both.
    """
    needs("rosbags.highlevel", "a ROS bag", "ros")
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; check the path")
    # a ROS 2 bag is a folder of which any file may be named
    in_folder = path.suffix != ".bag" and (path.parent / "metadata.yaml").is_file()
    return read_apart("a ROS bag", bag_channels, path.parent if in_folder else path)


def bag_channels(path: Path) -> Log:
    """What ``read_bag`` returns, with whatever errors rosbags has."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    rows: dict[tuple[str, Names], tuple[list[int], dict[str, list[float]]]] = {}
    usual = get_typestore(Stores.LATEST)
    with AnyReader([path], default_typestore=usual) as bag:
        for connection, stamp, raw in bag.messages():
            message = bag.deserialize(raw, connection.msgtype)
            named = connection.topic.strip("/"), _names(message)
            times, fields = rows.setdefault(named, ([], {}))
            times.append(_time(message, stamp))
            for name, value in _numbers(message, ""):
                fields.setdefault(name, []).append(value)
    found = Log()
    base = min((min(times) for times, _ in rows.values()), default=0) // _SECOND * _SECOND
    base = base if base > _CALENDAR else 0
    topics = [topic for (topic, _), (_, fields) in rows.items() if fields]
    for (topic, names), (counts, fields) in rows.items():
        about = names[1:] if names[:1] == (_ABOUT,) and 1 < topics.count(topic) <= _MANY else ()
        seconds = 1e-9 * np.array([count - base for count in counts], dtype=float)
        for name, values in fields.items():
            # an array that changes its length is no channel
            if len(values) == len(counts):
                own = name if topics.count(topic) == 1 else _of_its_name(name, names)
                key = f"{topic}{''.join(f'[{frame}]' for frame in about)}.{own}"
                found[key] = _with(found.get(key), Channel(seconds, np.array(values)))
    if not found:
        raise InputError("holds no numbers")
    return found


def _names(message: object) -> Names:
    """What a message calls the entries of its arrays, as those of joints do, or the frames that it
    is about; else nothing.
    """
    for kind in ("name", "joint_names"):
        names = getattr(message, kind, None)
        if isinstance(names, list) and names and all(isinstance(n, str) for n in names):
            return ("", *names)
    moved = getattr(message, "transforms", None)
    if isinstance(moved, list) and moved:
        return ("transforms", *(str(getattr(each, "child_frame_id", "")) for each in moved))
    frames = getattr(message, "child_frame_id", ""), _frame(message)
    return (_ABOUT, "/".join(filter(None, frames))) if any(frames) else ()


def _frame(message: object) -> str:
    told = getattr(getattr(message, "header", None), "frame_id", "")
    return told if isinstance(told, str) else ""


def _of_its_name(field: str, names: Names) -> str:
    """A field ``velocity[2]`` by the name of its entry; as it is where that is no name of one."""
    if not names or names[0] == _ABOUT:
        return field
    within, *entries = names
    found = (_WITHIN if within else _ENTRY).fullmatch(field)
    if found is None or (within and found[1] != within):
        return field
    at = int(found[2])
    alone = at < len(entries) and entries[at] and entries.count(entries[at]) == 1
    return f"{found[1]}[{entries[at]}]{found[3]}" if alone else field


def _with(first: Channel | None, more: Channel) -> Channel:
    """One channel of both, in the order of their times."""
    if first is None:
        return more
    times = np.concatenate([first.times, more.times])
    order = np.argsort(times, kind="stable")
    return Channel(times[order], np.concatenate([first.values, more.values])[order])


def _time(message: Any, stamp: int) -> int:
    """Time in ns."""
    header = getattr(getattr(message, "header", None), "stamp", None)
    seconds = getattr(header, "sec", 0) or 0
    if seconds or getattr(header, "nanosec", 0):
        return int(seconds) * _SECOND + int(header.nanosec)  # type: ignore[union-attr]
    return stamp


def _numbers(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """Every number of a message, with the path to it."""
    if isinstance(value, (bool, int, float, np.number)):
        yield name, float(value)
    elif isinstance(value, np.ndarray):
        if value.dtype.kind in "fiub" and value.size <= _LONGEST:
            for i, x in enumerate(value.ravel().tolist()):
                yield f"{name}[{i}]", float(x)
    elif isinstance(value, list):
        if len(value) <= _LONGEST:
            for i, each in enumerate(value):
                yield from _numbers(each, f"{name}[{i}]")
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name in ("header", "__msgtype__"):
                continue
            inner = f"{name}.{field.name}" if name else field.name
            yield from _numbers(getattr(value, field.name), inner)
