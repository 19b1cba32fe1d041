"""An Estimate in words: for a file, for a screen, for a notebook."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING

from freqid.data import in_python
from freqid.fitting.digits import in_digits, of_error, rounded

if TYPE_CHECKING:
    from freqid.fitting.estimate import Estimate


def as_dict(est: Estimate) -> dict[str, object]:
    """Plain numbers and strings."""
    table = est.parameters.astype(object).where(est.parameters.notna(), None)
    return {
        "parameters": table.to_dict(orient="index"),
        "cost": est.cost,
        "fit_percent": est.fit_percent,
        "converged": bool(est.converged),
        "message": est.message,
        "verdict": dataclasses.asdict(est.verdict),
        "warnings": list(est.warnings),
        "notes": list(est.notes),
        "witness": dataclasses.asdict(est.witness),
        "hold": est.hold.name,
        "hold_period": est.hold_period,
        "dt": est.dt,
        "covariance": est.covariance_matrix.tolist(),
    }


def _witness(est: Estimate) -> list[str]:
    """What the witness says, where there is one to hear."""
    if est.testimony is None:
        return []
    return [f"witness {est.witness.verdict}: {est.witness.sentence}"]


def _said(est: Estimate) -> list[str]:
    """The verdict, the witness, the warnings and the notes, a line each."""
    lines = [f"verdict: {est.verdict.grade}", *_witness(est)]
    lines += [f"warning: {w}" for w in est.warnings]
    return [*lines, *(f"note: {n}" for n in est.notes)]


def _widened(est: Estimate) -> dict[str, float]:
    """Standard errors that know how experiments differ, where these are named as unlike."""
    if not any(getattr(w, "kind", "") == "unlike experiments" for w in est.warnings):
        return {}
    wide = est.spread
    return {} if wide.empty else dict(wide["widened"].groupby(level="parameter").first())


def as_text(est: Estimate) -> str:
    """Each parameter with its error, then verdict, witness, warnings and notes."""
    lines = [f"<Estimate: {est.fit_percent:.2f} % fit, cost {est.cost:.4g}, {est.hold!r}"]
    wide = _widened(est)
    for name, row in est.parameters.iterrows():
        value = rounded(row["value"], row["std"])
        value = f"  {name} = {value} ± {of_error(row['std'])} {row['unit']}".rstrip()
        more = wide.get(str(name), 0.0) > row["std"]
        lines.append(
            f"{value} (± {of_error(wide[str(name)])} as the experiments differ)" if more else value
        )
    lines += [f"  {line}" for line in _said(est)]
    return "\n".join(lines) + ">"


def as_html(est: Estimate) -> str:
    """The same as a table with a list under it."""
    notes = "".join(f"<li>{escape(w)}</li>" for w in _said(est))
    head = f"fit {est.fit_percent:.2f} %, {escape(repr(est.hold))}"
    table, wide = est.parameters, _widened(est)
    if wide:
        table = table.assign(widened=[wide.get(str(n), s) for n, s in table["std"].items()])
    return f"<p>{head}</p>{in_digits(table).to_html(escape=True)}<ul>{notes}</ul>"


def call_of(model: object, count: int, given: Mapping[str, object]) -> str:
    """The call of ``fit`` as a user would type it, arguments at their defaults left out."""
    usual = {
        "initial_state": "estimate", "n_starts": "auto", "seed": 0, "domain": "frequency",
        "reference": "auto", "loss": "linear", "error": "linear",
    }  # fmt: skip
    shown = []
    for name, value in given.items():
        if value is None or (name in usual and isinstance(value, type(usual[name]))
                             and value == usual[name]):  # fmt: skip
            continue
        if name == "start":
            value = dict(value)  # type: ignore[call-overload]
        text = in_python(value) or (
            f"<array {value.shape}>" if hasattr(value, "shape") else repr(value)
        )
        shown.append(f"{name}={text}")
    data = "data" if count == 1 else f"[{count} data sets]"
    return f"fq.fit({', '.join(['model', data, *shown])})\n# model = {model!r}"
