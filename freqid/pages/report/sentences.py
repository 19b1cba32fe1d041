"""What a report says in words: whether to trust the estimate, and what was fitted."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import NamedTuple

from freqid.checks import InputError
from freqid.data import DataSet, FrequencyResponse
from freqid.fitting import Estimate, Verdict as Graded, data_digest
from freqid.lti import InputHolds, PeriodicHold
from freqid.models import GreyBox
from freqid.pages.report.figures import records
from freqid.plots import hold_in_words
from freqid.validation import compare, hold_bias

# experiments that a page can carry
_EXPERIMENTS = 50
# what other data leave may be so many times as much as the own do, or this many per cent; of
# another kind of data it may be half
_WORSE, _LEAST, _HALF = 1.0, 5.0, 50.0


class Verdict(NamedTuple):
    """Whether an estimate may be trusted, in plain words."""

    head: str
    text: str
    trusted: bool = False


def verdict(est: Estimate, validation: DataSet | None = None) -> Verdict:
    """Whether an estimate may be trusted, in plain words; other data have their say."""
    found = est.verdict
    if validation is not None:
        found = validated(est, validation)
    said = found.reasons[:1] if validation is None else [found.reasons[0], found.reasons[-1]]
    text = " ".join(f"{reason[0].upper()}{reason[1:]}." for reason in said)
    return Verdict(found.head, text, found.trusted)


def validated(est: Estimate, other: DataSet) -> Graded:
    """The verdict with what other data say of the model."""
    found = est.verdict
    kind = "response" if isinstance(other, FrequencyResponse) else "record"
    if data_digest(other) in map(data_digest, est.data):
        raise InputError(
            f"validation is a {kind} that was fitted, which the estimate explains by itself; give "
            "another one"
        )
    # the parts of a record and of a response that are explained are two measures
    alike = [d for d in est.data if isinstance(d, FrequencyResponse) == (kind == "response")]
    worst = float(compare(est, other, band=est.band).fit_percent.min())
    least, where = _HALF, ""
    if alike:
        own = float(compare(est, alike[0], band=est.band).fit_percent.min())
        least = own - _WORSE * max(100 - own, _LEAST)
        where = f" where what was fitted is to {own:.4g} %"
    if worst > least:
        said = f"another {kind} is explained to {worst:.4g} %"
        return Graded(found.grade, [*found.reasons, said])
    said = (
        f"validation: another {kind} is explained to {worst:.4g} %{where}; the model does not hold "
        "there"
    )
    useless = worst < 0 or found.grade == "do not use"
    return Graded("do not use" if useless else "doubt", [said, *found.reasons])


def bias(est: Estimate) -> dict[str, float]:
    """The bias bar, where a record remembers another hold than the fit assumed."""
    known = records(est)
    if not known or len(known) < len(est.data) or not isinstance(est.model, GreyBox):
        return {}
    if all(r.hold == est.hold for r in known) or "hold_period" in est.names:
        return {}
    try:
        return dict(hold_bias(est, known, band=est.band, weights=est.weights)["bias"])
    except InputError:
        return {}


def data(est: Estimate) -> list[tuple[str, str]]:
    """What was fitted and how that went, as pairs of a name and its value."""
    rows = [(f"experiment {i + 1}", repr(d)[1:-1]) for i, d in enumerate(est.data[:_EXPERIMENTS])]
    if len(est.data) > _EXPERIMENTS:
        rows.append(("and", f"{len(est.data) - _EXPERIMENTS} more"))
    assumed = "none: the plant itself, band-limited"
    if isinstance(est.hold, PeriodicHold):
        assumed = f"{hold_in_words(est.hold)} of {1e3 * est.hold.period:g} ms"
    elif isinstance(est.hold, InputHolds):
        assumed = ", ".join(h.name for h in est.hold.holds)
    return [
        *rows,
        ("hold in the fit", assumed),
        ("band", f"{est.band[0]:g} to {est.band[1]:g} Hz" if est.band else "all lines"),
        ("explained of what was fitted", f"{est.fit_percent:.4g} %"),
        ("cost", f"{est.cost:.6g}"),
        ("starts", f"{est.n_agreed} of {est.n_starts} agree"),
        ("converged", "yes" if est.converged else f"no: {est.message}"),
    ]


def versions() -> str:
    """What the numbers were made with."""
    packages = (f"{p} {version(p)}" for p in ("freqid", "numpy", "scipy"))
    return ", ".join([*packages, f"Python {platform.python_version()}"])
