"""Estimates that are kept: saved as JSON, loaded in another process, used again."""

from __future__ import annotations

import datetime
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import InputError, path_of
from freqid.data import DataSet, Record, whole_file
from freqid.fitting.clock_offset import NAME, behind_offset
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.grades import Verdict
from freqid.fitting.met import data_digest, remembered
from freqid.fitting.search.verdict import Witness
from freqid.fitting.tied import with_tied
from freqid.fitting.uncertainty.kept_box import KeptBox
from freqid.fitting.uncertainty.minimum import quantile
from freqid.models import GreyBox, hold_of_dict, hold_to_dict, model_of_dict, model_to_dict

if TYPE_CHECKING:
    import pandas as pd

Json = Any
Written = dict[str, Any]

# of the file's layout; a reader takes what is older
SCHEMA = 1


def save(est: Estimate, path: str | Path, overwrite: bool = False) -> None:
    """The work of ``est.save``."""
    path = path_of("path", path)
    if path.suffix.lower() != ".json":
        raise InputError(f"{path}: estimates are saved as .json")
    if path.exists() and not overwrite:
        raise InputError(f"{path} is there already; give another name, or overwrite=True")
    text = json.dumps(_plain(written(est)), indent=1, allow_nan=False, ensure_ascii=False)
    with whole_file(path) as beside:
        beside.write_text(text + "\n", encoding="utf-8")


def written(est: Estimate) -> Written:
    """Everything that is kept of an estimate."""
    import freqid

    table, (said, step) = est.parameters.loc[list(est.names)], remembered(est)
    return {
        **est.to_dict(),
        "schema": SCHEMA,
        "kind": "freqid estimate",
        "freqid": freqid.__version__,
        "saved": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "model": model_to_dict(est.model),
        "names": list(est.names),
        "units": list(est.units),
        "values": est.values,
        "lower": table["lower"].to_numpy(),
        "upper": table["upper"].to_numpy(),
        "told_by": est.told_by,
        "nominal": est.nominal,
        "covariance": est.covariance_matrix,
        "n_evaluations": est.n_evaluations,
        "n_rows": est.n_rows,
        "n_starts": est.n_starts,
        "n_agreed": est.n_agreed,
        "held": hold_to_dict(est.hold),
        "remembered": None if said is None else hold_to_dict(said),
        "input_dt": step,
        "band": est.band,
        "weights": est.weights if isinstance(est.weights, str) else None,
        "call": est.call,
        "findings": [_finding(w) for w in est.warnings],
        "data": vars(est).get("described") or [_described(d) for d in est.data],
        "suspects": _table(est.suspects),
        "modes": _modes_of(est),
        "box": _box_of(est),
    }


def _modes_of(est: Estimate) -> Written | None:
    """The table of modes, of a loaded estimate the one that it has kept."""
    known = vars(est).get("known_modes")
    return None if known is None and est.problem is None else _table(est.modes())


def _box_of(est: Estimate) -> Written | None:
    """How a black box scatters; None for other models, and where that is not known."""
    box: KeptBox | None = vars(est).get("box")
    if box is None and est.problem is not None and not isinstance(est.model, GreyBox):
        box = KeptBox.of(est.problem.structure, est.problem.x, est.scatter)
    return None if box is None else box.to_dict()


def load(path: str | Path, model: GreyBox | None = None) -> Estimate:
    """An estimate that ``est.save`` wrote: it simulates, draws and converts as before.

    What needs the data (profiles, bootstrap, spread) is not kept; verdict, witness, suspects and
    warnings are those that were saved.

    Args:
        path: a .json file.
        model: the plant, where its function has no import path (a lambda, or one of a script).

    Raises FileNotFoundError for a missing file, ValueError for one that is damaged, newer than
    this version, or of a plant that cannot be imported and is not given.

    >>> import tempfile, pathlib, freqid as fq
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "lag.json"
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3).with_noise(0.01)
    >>> fq.fit(fq.first_order(), record).save(path)
    >>> fq.load(path).verdict.grade
    'trust'
    """
    path = path_of("path", path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist or is not a file; check the path")
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: is not JSON or is damaged ({error})") from None
    if not isinstance(kept, dict) or kept.get("kind") != "freqid estimate":
        raise InputError(f"{path}: is not an estimate that est.save() wrote")
    if not isinstance(kept.get("schema"), int) or kept["schema"] > SCHEMA:
        raise InputError(
            f"{path}: was written by freqid {kept.get('freqid')} in a newer layout; update freqid"
        )
    try:
        return _estimate(_numbers(kept), model)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({type(error).__name__}: {error})") from None


def _estimate(kept: Written, model: GreyBox | None) -> Estimate:
    import pandas as pd

    names, values = kept["names"], np.array(kept["values"], dtype=float)
    P = len(names)
    covariance = np.array(kept["covariance"], dtype=float).reshape(P, P)
    if values.shape != (P,):
        raise InputError(f"has {P} names and {len(values)} values")
    if model is not None and NAME in names and NAME not in model.values:
        # the fit itself has added it to the plant
        model = behind_offset(model)
    est = Estimate(
        model=model_of_dict(kept["model"], model),
        names=names, values=values, nominal=np.array(kept["nominal"], dtype=float),
        units=kept["units"], uncertainty=covariance, cost=float(kept["cost"]),
        fit_percent=float(kept["fit_percent"]), converged=bool(kept["converged"]),
        message=str(kept["message"]), n_evaluations=int(kept["n_evaluations"]),
        hold=hold_of_dict(kept["held"]), dt=float(kept["dt"]), n_rows=int(kept["n_rows"]),
        n_starts=int(kept["n_starts"]), n_agreed=int(kept["n_agreed"]),
        band=None if kept["band"] is None else tuple(kept["band"]), weights=kept["weights"],
        call=str(kept["call"]), notes=list(kept["notes"]),
    )  # fmt: skip
    # what an older file does not say
    told_by = float(kept.get("told_by", np.inf))
    witness, verdict, said = kept["witness"], kept["verdict"], kept.get("remembered")
    table = pd.DataFrame(
        {
            "value": values, "std": np.sqrt(np.diag(covariance)),
            "lower": np.array(kept["lower"], dtype=float),
            "upper": np.array(kept["upper"], dtype=float),
            "nominal": est.nominal, "unit": list(kept["units"]),
        },
        index=pd.Index(names, name="parameter"),
    )  # fmt: skip
    # what was computed from the data is what it was
    est.__dict__.update(
        witness=Witness(**{**witness, "degrees": tuple(witness["degrees"])}),
        verdict=Verdict(verdict["grade"], list(verdict["reasons"])),
        warnings=[Finding(w["kind"], w["sentence"], w["severity"], w["number"], w.get("p_value"))
                  for w in kept["findings"]],
        told_by=told_by,
        _parameters=with_tied(table, est, quantile(told_by, 0.95)),
        described=kept["data"],
        digests=[d["sha256"] for d in kept["data"]],
        remembered=(None if said is None else hold_of_dict(said), kept.get("input_dt")),
    )  # fmt: skip
    if kept.get("box") is not None:
        vars(est)["box"] = KeptBox.from_dict(kept["box"])
    for name, key in (("suspects", "suspects"), ("known_modes", "modes")):
        if kept.get(key) is not None:
            est.__dict__[name] = _frame(kept[key])
    return est


def _table(frame: pd.DataFrame) -> Written:
    """A table as columns by name and its index."""
    return {
        "columns": {str(c): frame[c].tolist() for c in frame.columns},
        "index": list(frame.index), "name": frame.index.name,
    }  # fmt: skip


def _frame(kept: Written) -> pd.DataFrame:
    import pandas as pd

    index = pd.Index(kept["index"], name=kept["name"])
    return pd.DataFrame(kept["columns"], index=index)


def _finding(warning: str) -> Written:
    kind = getattr(warning, "kind", warning.partition(": ")[0])
    return {
        "kind": kind, "sentence": warning[len(kind) + 2 :],
        "severity": getattr(warning, "severity", "serious"),
        "number": getattr(warning, "number", None),
        "p_value": getattr(warning, "p_value", None),
    }  # fmt: skip


def _described(data: DataSet) -> Written:
    """What the data were, and a fingerprint that tells whether others are the same."""
    about = {
        "kind": type(data).__name__, "inputs": list(data.input_names),
        "outputs": list(data.output_names), "dt": data.dt, "conditions": dict(data.conditions),
        "samples": len(data.u if isinstance(data, Record) else data.frequency),
        "sha256": data_digest(data),
    }  # fmt: skip
    if isinstance(data, Record):
        about |= {"input_dt": data.input_dt, "hold": hold_to_dict(data.hold)}
    return about


def _plain(value: object) -> object:
    """The same in what JSON has: numbers that it lacks become words."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return number if math.isfinite(number) else f"number {number}"
    if isinstance(value, np.integer):
        return int(value)
    return value


def _numbers(value: Json) -> Json:
    """The words back to numbers."""
    if isinstance(value, dict):
        return {k: _numbers(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    if value in ("number nan", "number inf", "number -inf"):
        return float(value.removeprefix("number "))
    return value
