"""What the explorer says of a fit in a sentence, and what it gives to take away."""

from __future__ import annotations

from urllib.parse import quote

import numpy as np

from freqid.fitting import of_error
from freqid.pages.explorer.scene import Scene, label_of, rounding_said

# reasons of a verdict that are shown
_REASONS = 4
# part by which a number may be off and is right
_RIGHT = 0.02
# standard errors beyond which one of several numbers lies once in a hundred pages
_SURE = 3.1


def sentence(shown: Scene) -> tuple[str, bool]:
    """What the reader should see, in words, and whether it is a doubt."""
    est = shown.estimate
    if shown.measured and not shown.alone:
        m, p = shown.slow.n_inputs, shown.slow.n_outputs
        return (
            f"The record has {m} inputs and {p} outputs; only the first of each is drawn, and the "
            "plants here have one: select(...) one of each",
            True,
        )
    if est is None:
        return f"No fit: {shown.message}", True
    if label_of(shown.state) == "black box, ZOH":
        return _of_black_box(shown)
    truth = shown.state.model()
    std = dict(zip(est.names, np.sqrt(np.diag(est.covariance_matrix)), strict=True))
    away = {n: est[n] / truth[n] - 1 for n in est.names if truth[n]}
    # a sign that is impossible says more than any percentage; of nothing there is no part
    worst = min(
        est.names, key=lambda n: (n not in away, est[n] * truth[n] > 0, -abs(away.get(n, 0)))
    )
    found = f"{est[worst]:.4g}{_give_or_take(std[worst], est[worst])}"
    text = (
        f"{worst} = {found} where {truth[worst]:.4g} is {shown.truth}"
        if abs(away.get(worst, 1)) > 1e-3
        else f"Every parameter is {shown.truth} to a tenth of a per cent"
    )
    # beside one's own record the plant is a guess, and no estimate is wrong for leaving it
    wrong = not shown.measured and any(
        abs(part) > max(_RIGHT, _SURE * std[n] / abs(truth[n])) for n, part in away.items()
    )
    fitted = f"{est.fit_percent:.4g} % explained" if shown.measured else ""
    said = ". ".join(part for part in (text, fitted, shown.message) if part)
    return said, bool(est.signs) or wrong


def _give_or_take(std: float, value: float) -> str:
    """The standard error, where it is worth a word."""
    return f" ± {of_error(std)}" if np.isfinite(std) and std > 1e-4 * abs(value) else ""


def _of_black_box(shown: Scene) -> tuple[str, bool]:
    """How far its response is off that of the plant, where it was excited."""
    est = shown.estimate
    assert est is not None
    text = f"Black box: {est.fit_percent:.1f} % explained"
    if shown.measured:
        return ". ".join(part for part in (text, shown.message) if part), bool(est.signs)
    responses = shown.responses
    true, found = next(iter(responses.values())), responses["estimate"]
    inside = (true.frequency >= shown.state.low) & (true.frequency <= shown.state.high)
    if not inside.any():
        return text, bool(est.signs)
    off = np.abs(found.response[0, 0] / true.response[0, 0] - 1)[inside]
    worst, f = float(off.max()), float(true.frequency[inside][off.argmax()])
    text += f"; its response is off by up to {100 * worst:.3g} %, at {f:.3g} Hz"
    return text, bool(est.signs) or worst > _RIGHT


def believed(shown: Scene) -> tuple[list[str], bool]:
    """Whether the estimate may be believed, and why, what a black box says beside it; whether it
    is trusted.
    """
    est = shown.estimate
    if est is None:
        return ["No fit, no verdict."], False
    with rounding_said():
        graded, witness = est.verdict, est.witness
    said = [graded.head, *graded.reasons[:_REASONS]]
    said.append(f"black box beside it: {witness.verdict}: {witness.sentence}")
    return [f"{s[0].upper()}{s[1:]}" for s in said], graded.trusted


def table(shown: Scene) -> str:
    """The responses that are drawn, as CSV."""
    with rounding_said():
        curves = {n: r for n, r in shown.responses.items() if n != "measured"}
    first = next(iter(curves.values()))
    columns = {"frequency [Hz]": first.frequency}
    for name, frf in curves.items():
        columns[f"{name}: real"] = frf.response[0, 0].real
        columns[f"{name}: imaginary"] = frf.response[0, 0].imag
    rows = np.column_stack(list(columns.values()))
    head = ",".join(f'"{name}"' for name in columns)
    return "\n".join([head, *(",".join(f"{v:.9g}" for v in row) for row in rows)]) + "\n"


def as_link(text: str, kind: str) -> str:
    """A text as the address of itself, for a link that saves it."""
    return f"data:{kind};charset=utf-8,{quote(text)}"
