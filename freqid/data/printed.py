"""Records as text and as tables."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from freqid.data.record import Record


def as_text(record: Record) -> str:
    """One line: channels, samples, hold and conditions."""
    shown = f"{record.n_samples} samples at {record.dt:g} s"
    if record.factor > 1:
        shown += f", input at {record.input_dt:g} s"
    channels = f"{', '.join(record.input_names)} -> {', '.join(record.output_names)}"
    at = f", {_conditions(record)}" if record.conditions else ""
    return f"<Record {channels}: {shown}, {record.hold!r}{at}>"


def as_html(record: Record) -> str:
    """A table of the same and the notes."""
    rows = {
        "inputs": ", ".join(record.input_names),
        "outputs": ", ".join(record.output_names),
        "samples": f"{record.n_samples}",
        "sample time": f"{record.dt:g} s",
        "input sample time": f"{record.input_dt:g} s",
        "duration": f"{record.duration:g} s",
        "hold": repr(record.hold),
    }
    if record.conditions:
        rows["conditions"] = _conditions(record)
    if record.notes:
        rows["notes"] = "; ".join(record.notes)
    body = "".join(f"<tr><th>{k}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
    return f"<table><caption>Record</caption>{body}</table>"


def _conditions(record: Record) -> str:
    return ", ".join(f"{name}={value:g}" for name, value in record.conditions.items())
