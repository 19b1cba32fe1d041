"""How an estimate is got again: lines of Python that read the data, make the plant and fit."""

from __future__ import annotations

import ast
import dataclasses
import datetime
import inspect
import math
import re
import types
from collections.abc import Callable, Mapping

import numpy as np

from freqid.data import DataSet, source
from freqid.fitting import Estimate, data_digest
from freqid.models import PLANTS, GreyBox, Parameter, model_to_dict
from freqid.pages.report.sentences import versions

# beyond so many parameters and records the lines are no longer read
_MOST = 100


def recipe(est: Estimate) -> str:
    """The lines; ``...`` with what it was stands for what cannot be read, imported or written."""
    if not est.call:
        return "(made without fit)"
    today = datetime.datetime.now(datetime.UTC).date()
    call, _, told = est.call.partition("\n# model = ")
    if len(est.names) > _MOST or len(est.data) > _MOST:
        return f"# {today}, {versions()}\n{est.call}"
    grey = isinstance(est.model, GreyBox)
    imports, code, plant = _grey_box(est) if grey else ([], [], _black_box(told))
    data = [_data(d) for d in est.data]
    if len(data) > 1:
        call = call.replace(f"[{len(data)} data sets]", "data", 1)
        lines = ["data = [", *(f"    {code},  # {said}" for code, said in data), "]"]
    else:
        lines = [f"data = {code}  # {said}" for code, said in data]
    return "\n".join(
        [f"# {today}, {versions()}", *imports, "import freqid as fq", "", *code,
         f"model = {plant or f'...  # {told}'}", *lines, f"est = {call}"]
    )  # fmt: skip


def _data(data: DataSet) -> tuple[str, str]:
    """What reads the data, and what is said of them."""
    call, digest = source(data), f"SHA-256 {data_digest(data)[:12]}"
    return ("...", f"{data!r}, {digest}") if call is None else (call, digest)


def _black_box(told: str) -> str | None:
    """A model without parameters of its own, which its words make again."""
    import freqid

    names = re.findall(r"\b([A-Z]\w*)\(", told)
    if not names or not all(hasattr(freqid, name) for name in names):
        return None
    return re.sub(r"\b([A-Z]\w*\()", r"fq.\1", told)


def _grey_box(est: Estimate) -> tuple[list[str], list[str], str | None]:
    """What is to be imported and written, and the plant as the fit began with it; None for a
    function that can be neither.
    """
    model = est.model
    began = dict(zip(est.names, est.nominal, strict=True))
    own = {n: v for n, v in began.items() if n in model.values and math.isfinite(v)}
    if (short := _ready_made(model.with_values(**own))) is not None:
        return [], [], short
    written = model_to_dict(model)
    imports: list[str] = []
    code: list[str] = []
    names: dict[str, str] = {}
    for key in ("matrices", "jacobian"):
        path, function = written[key], getattr(model, key)
        if function is None:
            continue
        if path is None:
            spelled = _spelled(function)
            if spelled is None:
                return [], [], None
            imports += [line for line in spelled[0] if line not in imports]
            code += [spelled[1], ""]
            names[key] = function.__name__
            continue
        module, _, name = path["function"].partition(":")
        imports.append(f"from {module} import {name.partition('.')[0]}")
        given = [tuple(a) if isinstance(a, list) else a for a in path.get("arguments", ())]
        names[key] = f"partial({', '.join([name, *map(repr, given)])})" if given else name
    if any(name.startswith("partial(") for name in names.values()):
        imports.insert(0, "from functools import partial")
    rows = [_parameter(p, began.get(p.name, p.value)) for p in model.parameters]
    if any(re.search(r"\binf\b", row.partition(", ")[2]) for row in rows):
        imports.insert(0, "from math import inf")
    fields = {f.name: f.default for f in dataclasses.fields(model) if f.init}
    more = [
        f"    {name}={names.get(name) or repr(_plain(getattr(model, name)))},"
        for name, usual in fields.items()
        if name not in ("matrices", "parameters")
        and getattr(model, name) != usual
        and getattr(model, name) not in ({}, None)
    ]
    lines = ["fq.GreyBox(", f"    {names['matrices']},", "    ["]
    lines += [f"        {row}," for row in rows] + ["    ],", *more, ")"]
    return imports, code, "\n".join(lines)


def _spelled(function: Callable[..., object]) -> tuple[list[str], str] | None:
    """Imports and text of a function that uses nothing else of its script; None for others."""
    if not isinstance(function, types.FunctionType) or not function.__name__.isidentifier():
        return None
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        return None
    if not text.startswith("def ") or function.__closure__:
        return None
    heading = ast.parse(text).body[0]
    assert isinstance(heading, ast.FunctionDef)
    parts = [heading.args, *([heading.returns] if heading.returns else [])]
    names = {n.id for part in parts for n in ast.walk(part) if isinstance(n, ast.Name)}
    names |= _names_in(function.__code__)
    used = {n: function.__globals__[n] for n in sorted(names) if n in function.__globals__}
    if not all(isinstance(g, types.ModuleType) for g in used.values()):
        return None
    imports = [
        f"import {module.__name__}" + (f" as {name}" if name != module.__name__ else "")
        for name, module in used.items()
        if name != "fq"
    ]
    return imports, text.rstrip()


def _names_in(code: types.CodeType) -> set[str]:
    """Names that code, or a function inside it, looks up around it, attributes among them."""
    inside = [_names_in(c) for c in code.co_consts if isinstance(c, types.CodeType)]
    return set(code.co_names).union(*inside)


def _ready_made(model: GreyBox) -> str | None:
    """A plant of freqid's own as it is called, with what was changed of it; None for others."""
    for make in PLANTS.values():
        base = make()
        own = {p.name: p for p in model.parameters}
        if model.matrices is not base.matrices or list(own) != [p.name for p in base.parameters]:
            continue
        values = {p.name: own[p.name].value for p in base.parameters}
        fixed = {p.name: own[p.name].fixed for p in base.parameters}
        moved = {p.name: values[p.name] for p in base.parameters if values[p.name] != p.value}
        again = base.with_values(**moved)
        held = [p.name for p in base.parameters if fixed[p.name] and not p.fixed]
        freed = [p.name for p in base.parameters if p.fixed and not fixed[p.name]]
        again = again.fix(*held) if held else again
        again = again.free(*freed) if freed else again
        if again != model:
            continue
        function, given = (getattr(make, "func", make), getattr(make, "args", ()))
        said = [*map(repr, given), *(f"{k}={v!r}" for k, v in moved.items())]
        text = f"fq.{function.__name__}({', '.join(said)})"
        text += f".fix({', '.join(map(repr, held))})" if held else ""
        return text + (f".free({', '.join(map(repr, freed))})" if freed else "")
    return None


def _plain(value: object) -> object:
    """What is written as it is read: mappings as dictionaries."""
    return dict(value) if isinstance(value, Mapping) else value


def _parameter(p: Parameter, began: float) -> str:
    """A parameter where the search began, what is as usual left out."""
    value = float(began) if math.isfinite(began) and p.lower <= began <= p.upper else p.value
    usual = Parameter(p.name, value)
    own = {f.name: getattr(p, f.name) for f in dataclasses.fields(p)[2:]}
    said = [f"{k}={_number(v)}" for k, v in own.items() if v != getattr(usual, k)]
    return f"fq.Parameter({', '.join([repr(p.name), repr(value), *said])})"


def _number(value: object) -> str:
    """Numbers of numpy as Python writes them."""
    if isinstance(value, tuple):
        return f"({', '.join(_number(v) for v in value)})"
    return repr(value.item() if isinstance(value, np.generic) else value)
