"""Models as plain numbers and names, for a file, and back.

A grey box is its function's import path and its parameters: no code is written, and none is run but
what that path imports.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from freqid.checks import InputError
from freqid.lti import BandLimited, Hold, InputHolds, StateSpace
from freqid.models.grey_box import GreyBox
from freqid.models.model import Model
from freqid.models.output_error import DiscreteModel
from freqid.models.parameter import Parameter
from freqid.models.transfer_function import ContinuousModel

Written = dict[str, Any]
Given = Mapping[str, Any]
Function = Callable[..., Any]


def model_to_dict(model: Model) -> Written:
    """A model as a dictionary that JSON takes."""
    if isinstance(model, GreyBox):
        return {
            "kind": "GreyBox",
            "name": model.name,
            "matrices": _path(model.matrices),
            "jacobian": None if model.jacobian is None else _path(model.jacobian),
            "parameters": [dataclasses.asdict(p) for p in model.parameters],
            "ties": dict(model.ties),
            "conditions": dict(model.conditions),
            "inputs": list(model.inputs or ()),
            "outputs": list(model.outputs or ()),
            "input_delay": model.input_delay,
            "vectorized": model.vectorized,
        }
    if not isinstance(model, DiscreteModel | ContinuousModel):
        raise InputError(f"model={type(model).__name__} cannot be written to a file")
    names = {"inputs": list(model.inputs or ()), "outputs": list(model.outputs or ())}
    matrices = {letter: M.tolist() for letter, M in zip("ABCD", model.state_space(), strict=True)}
    if isinstance(model, DiscreteModel):
        hold = hold_to_dict(model.hold)
        return {
            "kind": "DiscreteModel",
            "matrices": matrices,
            "dt": model.dt,
            "hold": hold,
            "stable": model.stable,
            **names,
        }
    return {
        "kind": "ContinuousModel", "matrices": matrices, "delay": model.delay, **names,
        "denominator": model.denominator.tolist(), "numerators": model.numerators.tolist(),
    }  # fmt: skip


def model_of_dict(written: Given, given: GreyBox | None = None) -> Model:
    """The model that was written; ``given`` is the plant where its function cannot be imported.

    Raises ValueError for another kind, a function that is not there, or a given plant with other
    parameters.
    """
    kind = written.get("kind")
    names = {"input_names": written.get("inputs", ()), "output_names": written.get("outputs", ())}
    if kind == "GreyBox":
        return _grey_box(written, given)
    if kind not in ("DiscreteModel", "ContinuousModel"):
        raise InputError(f"kind={kind!r} is not a model that freqid knows")
    own = written["matrices"]
    shape = len(own["A"]), len(names["input_names"]), len(names["output_names"])
    n, m, p = shape
    sizes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = StateSpace(*(np.array(own[x], dtype=float).reshape(sizes[x]) for x in "ABCD"))
    if kind == "DiscreteModel":
        stable = bool(written.get("stable", False))
        hold = hold_of_dict(written["hold"])
        return DiscreteModel(matrices, float(written["dt"]), hold, **names, stable=stable)
    return ContinuousModel(
        matrices, np.array(written["denominator"]), np.array(written["numerators"]), **names,
        delay=float(written["delay"]),
    )  # fmt: skip


def _grey_box(written: Given, given: GreyBox | None) -> GreyBox:
    parameters = [
        Parameter(**{**p, "physical": tuple(p["physical"]),
                     "prior": None if p["prior"] is None else tuple(p["prior"])})
        for p in written["parameters"]
    ]  # fmt: skip
    if given is not None:
        if not isinstance(given, GreyBox):
            raise InputError(f"model={type(given).__name__} is not a GreyBox")
        wanted, there = [p.name for p in parameters], list(given.values)
        if wanted != there:
            raise InputError(
                f"model has the parameters {', '.join(there)}; the file was written of a plant "
                f"with {', '.join(wanted)}"
            )
        return dataclasses.replace(given, parameters=parameters)
    if written["matrices"] is None:
        raise InputError(
            f"the function of {written['name']!r} has no import path (a lambda, or one of a "
            "script); give the plant: load(path, model=plant)"
        )
    jacobian = written.get("jacobian")
    delay = written["input_delay"]
    return GreyBox(
        _function(written["matrices"]), parameters, outputs=written["outputs"],
        inputs=written["inputs"], name=written["name"], vectorized=written["vectorized"],
        ties=written["ties"], conditions=written.get("conditions", {}),
        jacobian=None if jacobian is None else _function(jacobian),
        input_delay=tuple(delay) if isinstance(delay, list) else delay,
    )  # fmt: skip


def _path(function: Function) -> Written | None:
    """Where a function can be imported from, with what it was called with; None for nowhere."""
    if isinstance(function, partial):
        inner = _path(function.func)
        plain = all(isinstance(a, (int, float, str, tuple)) for a in function.args)
        if inner is None or function.keywords or not plain:
            return None
        return {**inner, "arguments": [list(a) if isinstance(a, tuple) else a
                                       for a in function.args]}  # fmt: skip
    module, name = getattr(function, "__module__", ""), getattr(function, "__qualname__", "")
    if not name or "<" in name or module in ("", "__main__") or isinstance(function, type):
        return None
    return {"function": f"{module}:{name}"}


def _function(path: Given) -> Function:
    module, _, name = str(path["function"]).partition(":")
    try:
        found: Any = importlib.import_module(module)
        for part in name.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"the plant's function {path['function']} cannot be imported ({error}); give the "
            "plant: load(path, model=plant)"
        ) from None
    if not callable(found):
        raise InputError(f"{path['function']} is no function")
    given = path.get("arguments")
    if given is None:
        return found
    return partial(found, *(tuple(a) if isinstance(a, list) else a for a in given))


def hold_to_dict(hold: Hold) -> Written:
    """A hold as its name and period."""
    if isinstance(hold, InputHolds):
        return {"each": [hold_to_dict(h) for h in hold.holds]}
    return {"name": hold.name, "period": getattr(hold, "period", None)}


def hold_of_dict(written: Given) -> Hold:
    """The hold that was written; ValueError for an unknown name."""
    if "each" in written:
        return InputHolds(tuple(hold_of_dict(h) for h in written["each"]))
    name, period = written.get("name"), written.get("period")
    if name not in Hold.named:
        raise InputError(f"hold {name!r} is not one of {', '.join(Hold.named)}")
    return BandLimited() if period is None else Hold.named[name].at(float(period))
