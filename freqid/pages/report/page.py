"""An estimate as one HTML page that works offline: may it be trusted, and why."""

from __future__ import annotations

import base64
from importlib import resources
from pathlib import Path

from freqid.checks import InputError, flag, path_of
from freqid.data import DataSet, FrequencyResponse, Record, check_replacing, whole_file
from freqid.fitting import Estimate
from freqid.models import GreyBox
from freqid.pages.report.figures import figures
from freqid.pages.report.recipe import recipe
from freqid.pages.report.sentences import bias, data, verdict
from freqid.pages.report.tables import correlations, modes, parameters, spread, tests

# what tells such a page from another, and in how many bytes of its beginning
_MARK, _HEAD = b'content="freqid report"', 1000


def write_report(
    est: Estimate,
    path: str | Path,
    title: str | None = None,
    validation: DataSet | None = None,
    overwrite: bool = False,
) -> None:
    """Write the page; see ``Estimate.report``."""
    try:
        import jinja2
    except ImportError:
        raise InputError("a report needs jinja2; pip install 'freqid[report]'") from None
    path = path_of("path", path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"path={str(path)!r} must end in .html")
    if not isinstance(validation, Record | FrequencyResponse | None):
        raise InputError(
            f"validation={type(validation).__name__} is neither a Record nor a FrequencyResponse; "
            "of several give one, and est.compare the others"
        )
    if not (flag("overwrite", overwrite) or _is_report(path)):
        check_replacing(path, overwrite=False)
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("freqid.pages.report", ""),
        autoescape=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    drawn, away = figures(est, validation), bias(est)
    found = verdict(est, validation)
    left = tests(est)
    page = environment.get_template("report.html.j2").render(
        title=title or f"Estimate of {_named(est)}",
        verdict=found,
        warnings=list(est.warnings),
        witness=None if est.testimony is None else est.witness,
        notes=list(est.notes),
        parameters=parameters(est, away),
        bias_note="The bias is what the assumed hold adds: the estimate less that under the hold "
        "which the records remember."
        if away
        else "",
        modes=modes(est),
        spread=spread(est),
        correlations=correlations(est) if isinstance(est.model, GreyBox) else None,
        plots=drawn,
        figures=[{"data": f.data, "layout": f.layout} for f in drawn],
        tests=left,
        # of the estimate itself: validation data are asked for themselves
        weighed=found.trusted and not all(t["passed"] for t in left),
        data=data(est),
        call=recipe(est),
        plotly=_plotly() if drawn else "",
    )
    with whole_file(path) as beside:
        beside.write_text(page, encoding="utf-8")


def _plotly() -> str:
    """The basic bundle of plotly.js (MIT license), packed; the page unpacks it by itself."""
    packed = resources.files("freqid.pages.report").joinpath("plotly-basic.min.js.gz")
    return base64.b64encode(packed.read_bytes()).decode("ascii")


def _is_report(path: Path) -> bool:
    """Whether a file is a page of this kind, which a new one may replace."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _MARK in file.read(_HEAD)


def _named(est: Estimate) -> str:
    """A plant by its name, a black box by what it is."""
    name = getattr(est.model, "name", "")
    kind = "a sampled" if est.model.dt else "a continuous"
    return name or f"{kind} black box of order {len(est.model.poles)}"
