"""Models on the command line: built in, black boxes, or a user's own from a file."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path

import freqid as fq
from freqid.checks import InputError, unknown
from freqid.fitting import FITTERS
from freqid.models import PLANTS, GreyBox

BLACK_BOXES = ("output-error", "transfer-function")

TEMPLATE = '''"""A plant of your own: freqid fit DATA --model {name}:plant"""

import freqid as fq


def matrices(J, k, d):
    """A, B, C, D of x' = A x + B u, y = C x + D u, in SI units.

    Here a mass on a spring: the input is a torque (N m), the output the angle (rad), the states are
    angle and velocity. Write the equations of yours; the arguments are the parameters below.
    """
    A = [[0, 1], [-k / J, -d / J]]
    B = [[0], [1 / J]]
    C = [[1, 0]]
    D = None  # no direct way from input to output
    return A, B, C, D


plant = fq.GreyBox(
    matrices,
    parameters=[
        # name, a value to begin from, unit; lower= and upper= bound it, fixed=True keeps it
        fq.Parameter("J", 0.1, "kg m²", lower=0),
        fq.Parameter("k", 100.0, "N m/rad", lower=0),
        fq.Parameter("d", 0.1, "N m s/rad", lower=0),
    ],
    inputs=["torque"],
    outputs=["angle"],
    name="{stem}",
)
'''


def model_of(
    text: str,
    order: int | None = None,
    zeros: int | None = None,
    poles: int | None = None,
    feedthrough: bool = False,
    stable: bool = False,
    delay: str | None = None,
) -> object:
    """The model that ``--model`` names; ValueError, with what there is, for another, and for an
    option that it does not have.
    """
    for option, given, owner in (
        ("--order", order, "output-error"), ("--feedthrough", feedthrough, "output-error"),
        ("--stable", stable, "output-error"), ("--zeros", zeros, "transfer-function"),
        ("--poles", poles, "transfer-function"), ("--delay", delay, "transfer-function"),
    ):  # fmt: skip
        if given not in (None, False) and text != owner:
            raise InputError(f"{option} is {owner}'s; {text} says such things by itself")
    if text == "output-error":
        return fq.OutputError(3 if order is None else order, feedthrough, stable)
    if text in PLANTS:
        return PLANTS[text]()
    if text == "transfer-function":
        n = 3 if poles is None else poles
        return fq.TransferFunction(n - 1 if zeros is None else zeros, n, _late(delay))
    file, _, name = text.rpartition(":")
    if not file or not name:
        known = [*PLANTS, *BLACK_BOXES]
        raise InputError(f"{unknown('--model', text, known)}; or your_file.py:plant")
    return from_file(Path(file), name)


def _late(delay: str | None) -> float | str:
    if delay is None or delay == "estimate":
        return delay or 0.0
    try:
        return float(delay)
    except ValueError:
        raise InputError(f"--delay {delay} is no time in s; expected one, or estimate") from None


def in_python(text: str) -> tuple[str, str]:
    """How Python comes by the model that ``--model`` names: what it imports, and calls."""
    file, _, name = text.rpartition(":")
    if not file:
        return "", f"fq.{text.replace('-', '_')}()"
    made = "()" if f"def {name}(" in Path(file).read_text() else ""
    return "import runpy", f"runpy.run_path({file!r})[{name!r}]{made}"


def from_file(path: Path, name: str) -> object:
    """The model called ``name`` in a Python file, or what a function of that name returns."""
    if not path.is_file():
        raise FileNotFoundError(f"--model {path} does not exist or is not a file; check the path")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise InputError(f"--model {path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the user's file may raise anything
        raise InputError(f"--model {path}: {type(error).__name__}: {error}") from None
    kinds = tuple(FITTERS)
    models = [n for n, v in vars(module).items() if isinstance(v, kinds)]
    if not hasattr(module, name):
        raise InputError(f"{path}: {unknown('--model', name, models)}")
    found = getattr(module, name)
    if not isinstance(found, kinds) and callable(found):
        try:
            found = found()
        except TypeError as error:
            raise InputError(f"{path}: {name} makes no model by itself ({error})") from None
    if not isinstance(found, kinds):
        raise InputError(
            f"{path}: {name} is a {type(found).__name__}; expected a GreyBox or a black box"
        )
    return found


def pairs(option: str, given: Sequence[str] | None) -> dict[str, float]:
    """``name=value`` texts as numbers by name."""
    found = {}
    for name, value in texts(option, given, "k=1.5e5").items():
        try:
            found[name] = float(value)
        except ValueError:
            raise InputError(
                f"{option} {name}={value} is not NAME=VALUE, such as {option} k=1.5e5"
            ) from None
    return found


def texts(option: str, given: Sequence[str] | None, such_as: str = "time=ms") -> dict[str, str]:
    """``name=text`` as texts by name."""
    found = {}
    for text in given or ():
        name, mark, value = text.partition("=")
        if not mark or not name.strip():
            raise InputError(f"{option} {text} is not NAME=VALUE, such as {option} {such_as}")
        found[name.strip()] = value.strip()
    return found


def with_options(
    model: object,
    fix: Sequence[str],
    bounds: Sequence[tuple[str, float, float]],
    prior: Sequence[tuple[str, float, float]],
) -> object:
    """The plant with parameters fixed, bounded and believed in."""
    if not (fix or bounds or prior):
        return model
    if not isinstance(model, GreyBox):
        raise InputError("--fix, --bounds and --prior need a plant with parameters")
    model = model.fix(*fix) if fix else model
    if bounds:
        model = model.with_bounds(**{n: (low, high) for n, low, high in bounds})
    return model.with_prior(**{n: (mean, std) for n, mean, std in prior}) if prior else model
