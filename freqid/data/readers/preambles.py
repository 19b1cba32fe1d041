"""What makers print above their samples that no column says: headers, and a time by its step."""

from __future__ import annotations

import re
from typing import NamedTuple

from freqid.checks import InputError

# LabVIEW ends its headers so; the last of them stands before the line of names
_LABVIEW = re.compile(r"^\*\*\*End_of_Header\*\*\*[^\n]*\n", re.MULTILINE)
_LOOK = 2**16


class Body(NamedTuple):
    """A text without what its maker printed above it; ``clock`` is the start and the step in s of a
    first column that counts, ``notes`` what was taken off.
    """

    text: str
    clock: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()


def body_of(text: str) -> Body:
    """The table of a text, whatever stands above it."""
    ends = [m.end() for m in _LABVIEW.finditer(text[:_LOOK])]
    if ends:
        parts = len(re.findall(r"^X_Value\t", text, re.MULTILINE))
        if parts > 1:
            raise InputError(f"holds {parts} segments of LabVIEW; keep one of them in each file")
        body = text[ends[-1] :]
        said = ["the headers of LabVIEW were left out"]
        head, mark, rest = body.partition("\n")
        # a column of remarks, which rows without one leave out
        plain = re.sub(r"\tComment\s*$", "", head)
        above = text[: ends[-1]]
        step = re.search(r"^Delta_X\t([^\n]*)", above, re.MULTILINE)
        if step and re.search(r"^X_Columns\tNo\b", above, re.MULTILINE):
            # a column of times is kept free and not written
            plain = re.sub(r"^X_Value\b", "time", plain)
            dt = _one_step(step[1])
            said.append(f"the time counts in steps of {dt:g} s")
            return Body(plain + mark + rest, (0.0, dt), tuple(said))
        return Body(plain + mark + rest, notes=tuple(said))
    return _counted(text) or _stepped(text) or Body(text)


def _one_step(told: str) -> float:
    """The step in s that LabVIEW tells for each channel; InputError for several, or none."""
    try:
        steps = {float(x.replace(",", ".")) for x in told.split("\t") if x.strip()}
    except ValueError:
        steps = set()
    if len(steps) != 1 or not min(steps) > 0:
        raise InputError(
            f"its channels have steps Delta_X of {told.strip()!r}, of which one is expected; keep "
            "channels of one rate in a file"
        )
    return steps.pop()


def _counted(text: str) -> Body | None:
    """Rigol's oscilloscopes: ``X,CH1,Start,Increment``, below it these two numbers, then counts."""
    lines = text[:_LOOK].split("\n", 2)
    if len(lines) < 3:
        return None
    names, below = ([c.strip() for c in line.rstrip(", \t").split(",")] for line in lines[:2])
    lower = [n.casefold() for n in names]
    if lower[0] != "x" or not {"start", "increment"} <= set(lower) or len(below) < len(names):
        return None
    at = min(lower.index("start"), lower.index("increment"))
    try:
        start, step = (float(below[lower.index(n)]) for n in ("start", "increment"))
    except ValueError:
        return None
    if step <= 0:
        return None
    units = [f"{n} [{u}]" if u else n for n, u in zip(names[1:at], below[1:at], strict=True)]
    rest = text[len(lines[0]) + len(lines[1]) + 2 :]
    head = ",".join(["time", *units])
    if below[0].casefold().startswith("s") and not below[0].casefold().startswith("seq"):
        # seconds, which the step says once more
        return Body(f"{head}\n{rest}")
    return Body(f"{head}\n{rest}", (start, step), (f"the time counts in steps of {step:g} s",))


def _stepped(text: str) -> Body | None:
    """Rigol's newer ones: ``CH1V,CH2V,t0 =-1.0e-01, tInc = 1.0e-02`` above samples alone."""
    head = text[:_LOOK].partition("\n")[0]
    found = re.search(r",\s*t0\s*=\s*(\S+?)\s*,\s*tInc\s*=\s*([^\s,]+)[\s,]*$", head)
    if found is None:
        return None
    try:
        start, step = float(found[1]), float(found[2])
    except ValueError:
        return None
    said = (f"the time counts in steps of {step:g} s",)
    return (
        Body(head[: found.start()] + text[len(head) :], (start, step), said) if step > 0 else None
    )
