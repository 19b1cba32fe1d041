"""Whether a record can be trusted: stuck, saturated, quantised and constant channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, IntArray, an
from freqid.data.misread import misread
from freqid.data.record import Record

if TYPE_CHECKING:
    import pandas as pd

# a run of equal values, as a part of the record, that is called stuck
_STUCK = 0.05
# samples in a row at an extreme value that are an overload, where the last step to it was so many
# quantisation steps
_PLATEAU = 3
_FAST = 3
# values that a channel takes at the most to be called quantised
_FEW = 0.2
# values that tell a rate, and the part of them that stand as long
_RUNS, _ALIKE = 20, 0.95


def check_record(record: Record) -> pd.DataFrame:
    """What is wrong with a record's channels, one row a finding; empty where all is well.

    Columns channel, finding (``constant``, ``code``, ``wrapped``, ``stuck``, ``saturated``,
    ``repeated``, ``quantised``, ``offset``, ``unrelated reference``, ``note``), value and meaning.
    Quantisation is reported with its step q and the noise q/√12 that it makes (Widrow and Kollár,
    Quantization Noise, 2008).

    >>> import numpy as np
    >>> t = np.arange(1000) * 1e-3
    >>> u = np.sin(20 * t)
    >>> check_record(Record(u, np.clip(u, -0.5, 0.5), 1e-3))["finding"].tolist()
    ['saturated', 'saturated']
    """
    import pandas as pd

    an("record", record, Record)
    rows: list[dict[str, str | float]] = []
    channels = [
        *((name, x, False) for name, x in zip(record.input_names, record.inputs.T, strict=True)),
        *((name, x, True) for name, x in zip(record.output_names, record.outputs.T, strict=True)),
    ]
    if record.reference is not None and record.reference.ndim == 1:
        channels.append(("reference", record.reference, False))
    for name, x, measured in channels:
        rows += [{"channel": name, **finding} for finding in _findings(x, measured)]
    if record.reference is not None and record.reference.ndim == 1:
        rows += _reference(record)
    rows += [
        {"channel": "", "finding": "note", "value": np.nan, "meaning": n} for n in record.notes
    ]
    return pd.DataFrame(rows, columns=["channel", "finding", "value", "meaning"])


def _findings(x: FloatArray, measured: bool) -> list[dict[str, str | float]]:
    found: list[dict[str, str | float]] = []

    def add(finding: str, value: float, meaning: str) -> None:
        found.append({"finding": finding, "value": float(value), "meaning": meaning})

    N, span = len(x), float(np.ptp(x))
    if span == 0:
        add("constant", x[0], "the channel never moves; leave it out or check the sensor")
        return found
    if other := misread(x, measured):
        add(other.finding, other.value, other.meaning)
        return found
    changes = np.flatnonzero(np.diff(x)) + 1
    edges = np.concatenate([[0], changes, [N]])
    runs = np.diff(edges)
    # a record may rest before and after its excitation
    inner = runs[1:-1]
    times = _repeated(runs)
    if times > 1 and not measured:
        # a converter slower than the rows rests at no limit
        return _findings(x[edges[:-1]], measured)
    if times > 1:
        add("repeated", times, f"each value stands {times} times: the sensor is slower than the "
            f"rows; keep every {times}th output and all inputs, Record(u, y[::{times}], "
            f"dt={times} * dt, input_dt=dt)")  # fmt: skip
        return found
    values = np.unique(x)
    q = float(np.diff(values).min())
    at_limit, stairs = False, _is_staircase(x, edges, q)
    for value, which in ((x.max(), "largest"), (x.min(), "smallest")):
        plateaus = np.flatnonzero((x[edges[:-1]] == value) & (runs >= _PLATEAU))
        arrivals = plateaus[plateaus > 0]
        # a quantised sine lingers at its top too, but does not arrive there at full speed
        jumps = np.abs(value - x[edges[:-1][arrivals] - 1])
        if len(values) > 3 and not stairs and len(jumps) and np.median(jumps) > _FAST * q:
            at_limit = True
            add("saturated", value, f"{int((x == value).sum())} samples stand at the {which} value,"
                f" up to {int(runs[plateaus].max())} in a row: the sensor or the drive was "
                "overloaded")  # fmt: skip
    longest = int(inner.max(initial=0))
    steps = np.diff(values) / q
    stepped = bool(np.allclose(steps, np.round(steps), atol=1e-3))
    # what is no converter's count repeats no value while it is alive
    lively = measured and not stepped and np.mean(runs == 1) > _ALIKE
    least = 20 if lively else max(_STUCK * N, 20)
    if longest > least and not at_limit and not stairs and len(values) > 3:
        where = int(edges[1:-2][int(inner.argmax())]) if len(inner) else 0
        add("stuck", longest, f"{longest} samples in a row are equal, from sample {where}")
    if 3 < len(values) < _FEW * N and stepped:
        add("quantised", q, f"steps of {q:g} make a noise of {q / np.sqrt(12):.3g} rms, "
            f"{100 * q / np.sqrt(12) / x.std():.2g} % of the signal")  # fmt: skip
    if abs(x.mean()) > 3 * x.std():
        how = "; of a step fit(..., offset='estimate') leaves it free instead" if measured else ""
        add("offset", x.mean(), "the mean is far above the movement; detrend() takes it off" + how)
    return found


def _is_staircase(x: FloatArray, edges: IntArray, q: float) -> bool:
    """Whether a channel steps to most values and rests there, as at its largest and smallest."""
    at, runs = edges[1:-2], np.diff(edges)[1:-1]
    between = (x[at] > x.min()) & (x[at] < x.max())
    rests = (runs >= _PLATEAU) & (np.abs(x[at] - x[at - 1]) > _FAST * q)
    return bool(between.any()) and float(np.mean(rests[between])) > 0.5


def _repeated(runs: IntArray) -> int:
    """How many rows each value stands for, where nearly all stand as long; else 1."""
    inner = runs[1:-1]
    if len(inner) < _RUNS:
        return 1
    times = int(np.median(inner))
    # two neighbours may be equal by chance, or at rest
    return times if np.mean(inner % times == 0) > _ALIKE and (inner >= times).all() else 1


def _reference(record: Record) -> list[dict[str, str | float]]:
    u, r = record.inputs[:: record.factor][:, 0][: record.n_samples], record.reference
    assert r is not None
    if np.ptp(u) == 0 or np.ptp(r) == 0:
        return []
    U, R = np.fft.rfft(u - u.mean()), np.fft.rfft(r - r.mean())
    strong = np.abs(R) > 0.1 * np.abs(R).max()
    related = np.abs(np.vdot(R[strong], U[strong])) / (
        np.linalg.norm(R[strong]) * np.linalg.norm(U[strong])
    )
    if related > 0.1:
        return []
    return [
        {
            "channel": "reference",
            "finding": "unrelated reference",
            "value": float(related),
            "meaning": "it has next to nothing to do with the input, and cannot stand for it",
        }
    ]
