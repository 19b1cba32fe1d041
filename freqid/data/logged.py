"""Logs of many channels, each with a clock of its own: listed, chosen, made a record."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError, path_of, unknown
from freqid.data.clocks import begins_anew
from freqid.data.logs import record_from_logs
from freqid.data.readers.kinds import LOGS, Channel, Log
from freqid.data.record import Record
from freqid.data.regular_time import missing_of
from freqid.data.remembered import is_kept
from freqid.data.tables import frame_of
from freqid.data.time_column import with_time
from freqid.lti import Hold

if TYPE_CHECKING:
    import pandas as pd


def channels(path: str | Path, group: str | None = None) -> pd.DataFrame:
    """What a file holds: a row for each channel, with its rate and how regular that is.

    Columns: ``channel``, ``rate`` (Hz, the mean one), ``jitter`` (s, standard deviation of the
    steps), ``samples``, ``missing`` (samples that steps of several median ones lack), ``length``
    (s) and ``unit``; ``attrs["notes"]`` says where the time begins anew. Takes every file that
    ``read`` takes, and a ``group`` of it; raises ValueError like it.

    >>> import tempfile, pathlib, freqid as fq
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "step.csv"
    >>> fq.write(fq.Record([0.0, 1.0, 1.0], [0.0, 0.0, 0.5], dt=0.01), path)
    >>> fq.channels(path)["samples"].to_dict()
    {'u': 3, 'y': 3}
    """
    import pandas as pd

    found = log_of(path, group)
    rows = {name: _row(c) for name, c in found.items()}
    columns = ["channel", "rate", "jitter", "samples", "missing", "length", "unit"]
    made = pd.DataFrame([(name, *row) for name, row in rows.items()], list(rows), columns)
    anew = {name: begins_anew(c.times) for name, c in found.items()}
    made.attrs["notes"] = list(dict.fromkeys(
        f"the time begins anew in row {row}: one experiment after another"
        for row in anew.values() if row is not None
    ))  # fmt: skip
    return made


def _row(c: Channel) -> tuple[float, float, int, int, float, str]:
    count = len(c.times)
    if count < 2 or not np.isfinite(c.times).all() or c.times.max() <= c.times[0]:
        return float("nan"), float("nan"), count, 0, 0.0, c.unit
    gaps = np.diff(c.times)
    if begins_anew(c.times) is not None:
        # where one experiment follows another is no step
        gaps = gaps[gaps > 0]
    length, missing = float(gaps.sum()), missing_of(gaps)
    return len(gaps) / length, float(np.std(gaps)), count, missing, length, c.unit


def log_of(path: str | Path, group: str | None = None) -> Mapping[str, Channel]:
    """Every numeric channel of a file, or of one ``group`` of it, by name."""
    path = path_of("path", path)
    kind = kind_of(path)
    if kind in LOGS:
        if group is not None:
            raise InputError(f"{path}: group= is for files of several tables; leave it out")
        try:
            return LOGS[kind](path)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    frame = frame_of(path, group=group)
    units, found = frame.attrs.get("units", {}), {}
    for each in [frame, *frame.attrs.pop("apart", [])]:
        try:
            timed, _ = with_time(each, None, units, None, one_clock=False)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        times = timed["time"].to_numpy() if "time" in timed else np.full(len(timed), np.nan)
        for name in timed.columns:
            x = timed[name].to_numpy()
            if name == "time" or is_kept(name) or x.dtype.kind not in "fiub":
                continue
            there = np.isfinite(x.astype(float))
            unit = units.get(str(name), "")
            found[str(name)] = Channel(times[there], x[there].astype(float), unit)
    return found


def kind_of(path: Path) -> str:
    """The suffix that says which kind; a folder that holds a bag is one."""
    if path.is_dir() and (path / "metadata.yaml").is_file():
        return ".db3"
    return path.suffix.lower()


def logged_record(
    path: Path,
    inputs: Sequence[str] | str | None,
    outputs: Sequence[str] | str | None,
    hold: Hold | str | None,
    units: Mapping[str, str] | None,
    resample: bool,
) -> Record:
    """The record of some channels of a log."""
    found = log_of(path)
    u_names, y_names = _names("inputs", inputs, found), _names("outputs", outputs, found)
    own = {n: found[n].unit for n in (*u_names, *y_names) if found[n].unit}
    u_time, u = _together("inputs", u_names, found, held=hold in (None, "zoh"))
    y_time, y = _together("outputs", y_names, found, held=False)
    record = record_from_logs(
        u_time, u, y_time, y, "zoh" if hold is None else hold, resample,
        u_names, y_names, own | dict(units or {}),
    )  # fmt: skip
    notes = found.notes if isinstance(found, Log) else ()
    return dataclasses.replace(record, notes=(*record.notes, *notes)) if notes else record


def _names(
    argument: str, given: Sequence[str] | str | None, found: Mapping[str, Channel]
) -> list[str]:
    if given is None:
        shown = ", ".join(list(found)[:12]) + (", …" if len(found) > 12 else "")
        raise InputError(
            f"a log of {len(found)} channels; name {argument}=, freqid channels lists them: {shown}"
        )
    names = [given] if isinstance(given, str) else list(given)
    for name in names:
        if name not in found:
            raise InputError(unknown(argument, name, found))
    return names


def _together(
    argument: str, names: Sequence[str], found: Mapping[str, Channel], held: bool
) -> tuple[FloatArray, FloatArray]:
    """Stamps and samples (N,) or (N, channels) of channels of one clock.

    Inputs that were ``held`` may have several clocks: each keeps its value between its own stamps.
    """
    picked = [found[n] for n in names]
    times = picked[0].times
    alike = all(len(c.times) == len(times) and (c.times == times).all() for c in picked)
    if not alike and not held:
        raise InputError(
            f"{argument}={list(names)} have several clocks; take channels of one topic, or read "
            "them one at a time"
        )
    if not alike:
        begin = max(c.times[0] for c in picked)
        times = np.unique(np.concatenate([c.times[c.times >= begin] for c in picked] + [[begin]]))
        columns = [c.values[np.searchsorted(c.times, times, side="right") - 1] for c in picked]
    else:
        columns = [c.values for c in picked]
    samples = np.column_stack(columns)
    return times, samples[:, 0] if len(names) == 1 else samples
