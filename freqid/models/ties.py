"""Parameters tied to expressions of others: ``{"Ja": "2 * Jm"}``."""

from __future__ import annotations

import ast
import operator
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from freqid.checks import InputError, unknown

# what a tie may compute: no more than this is reachable from one
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow,
    ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_OF_ONE: dict[str, Callable[..., Any]] = {
    name: getattr(np, name)
    for name in (
        "sqrt", "cbrt", "square", "exp", "expm1", "log", "log1p", "log2", "log10", "sin", "cos",
        "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "arcsinh", "arccosh",
        "arctanh", "abs", "sign", "deg2rad", "rad2deg", "radians", "degrees",
    )
}  # fmt: skip
# as Python's own math calls them
_OF_ONE |= {
    f"a{name}": _OF_ONE[f"arc{name}"] for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")
}
_OF_TWO: dict[str, Callable[..., Any]] = {
    name: getattr(np, name) for name in ("arctan2", "hypot", "minimum", "maximum", "power")
}
_OF_TWO |= {"atan2": np.arctan2, "min": np.minimum, "max": np.maximum, "pow": np.power}
_CONSTANTS = {"pi": np.pi, "e": np.e}
# beyond this an expression is no relation between parameters
_LONGEST, _DEEPEST = 1000, 50


# numbers, or arrays of them, by name
Values = Mapping[str, Any]


class Ties:
    """Expressions by the name of the parameter that follows them.

    An expression is arithmetic, the constants pi and e, and mathematical functions of the other
    parameters. It is a tree that is walked: nothing of Python or numpy but these functions can be
    reached from it, and it keeps no state. It carries complex numbers and arrays through. Raises
    ValueError for anything else, for unknown names, a tie to a tied parameter, and what cannot be
    computed.
    """

    def __init__(self, expressions: Mapping[str, str | float], names: Sequence[str]) -> None:
        self.expressions = dict(expressions)
        self._trees: dict[str, ast.expr] = {}
        for name, text in self.expressions.items():
            if name not in names:
                raise InputError(unknown("ties", name, names))
            tree = _parsed(name, text)
            try:
                free = [_plain(n) for n in names if n not in self.expressions]
                _check(tree, free, [_plain(n) for n in self.expressions])
            except InputError as error:
                raise InputError(f"tie {name}={text!r:.80} {error}") from None
            self._trees[name] = tree

    def __setstate__(self, state: dict[str, dict[str, str | float]]) -> None:
        """Restore; what version 0.1.0 wrote has trees of another kind."""
        self.expressions = state["expressions"]
        self._trees = {name: _parsed(name, text) for name, text in self.expressions.items()}

    def resolve(self, values: Values) -> dict[str, Any]:
        """Values (numbers or arrays) with the tied ones computed from the others."""
        resolved = dict(values)
        if not self._trees:
            return resolved
        plain = {_plain(n): v for n, v in values.items()}
        for name, tree in self._trees.items():
            try:
                with np.errstate(all="ignore"):
                    found = _computed(tree, plain)
            except (ArithmeticError, TypeError, ValueError):
                raise InputError(
                    f"tie {name}={self.expressions[name]!r} cannot be computed"
                ) from None
            real = not np.iscomplexobj(found)
            if not real and not any(np.iscomplexobj(v) for v in values.values()):
                # a fractional power of a negative number
                raise InputError(f"tie {name}={self.expressions[name]!r} cannot be computed")
            resolved[name] = float(found) if real and np.ndim(found) == 0 else found
        return resolved


def _plain(name: str) -> str:
    """A name as Python's parser has it, which takes µ (micro) and μ (mu) for one letter."""
    return name if name.isascii() else unicodedata.normalize("NFKC", name)


def _parsed(name: str, text: object) -> ast.expr:
    """The tree of an expression; ValueError for what is none, or too large to be one."""
    problem = InputError(
        f"tie {name}={text!r:.80} is not an expression; expected one like '2 * Jm'"
    )
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        text = repr(float(text))
    if not isinstance(text, str):
        raise problem
    if "^" in text:
        raise InputError(f"tie {name}={text!r:.80}: a power is written **, not ^")
    if len(text) > _LONGEST:
        raise InputError(f"tie {name} has {len(text)} characters; expected at most {_LONGEST}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise problem from None


def _check(tree: ast.expr, free: Sequence[str], tied: Sequence[str], depth: int = 0) -> None:
    """ValueError for a tree that holds anything but what a tie may compute."""
    if depth > _DEEPEST:
        raise InputError(f"is nested more than {_DEEPEST} deep; write it shorter")
    inner: list[ast.expr] = []
    match tree:
        case ast.Constant(value=bool() | str() | bytes() | complex() | None):
            raise InputError(f"holds {tree.value!r:.40}; expected numbers")
        case ast.Constant(value=int() | float() as number):
            if abs(number) > 1e300:
                raise InputError("holds a number beyond 1e300")
        case ast.Name(id=name) if name in tied:
            raise InputError(f"refers to {name}, which is tied itself")
        case ast.Name(id=name) if name not in (*free, *_CONSTANTS):
            raise InputError(f"cannot be computed: {unknown('parameter', name, free)}")
        case ast.Name():
            pass
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            inner = [left, right]
        case ast.UnaryOp(operand=operand, op=op) if type(op) in _OPERATORS:
            inner = [operand]
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            if name not in (*_OF_ONE, *_OF_TWO):
                raise InputError(
                    f"cannot be computed: {unknown('function', name, [*_OF_ONE, *_OF_TWO])}"
                )
            if len(args) != (1 if name in _OF_ONE else 2):
                raise InputError(f"gives {name} {len(args)} arguments; expected "
                                 f"{1 if name in _OF_ONE else 2}")  # fmt: skip
            inner = args
        case _:
            raise InputError(
                f"is not arithmetic: {ast.unparse(tree)[:60]!r}; expected numbers, parameters, "
                f"+ - * / **, pi, e and functions ({', '.join([*_OF_ONE, *_OF_TWO])})"
            )
    for part in inner:
        _check(part, free, tied, depth + 1)


def _computed(tree: ast.expr, values: Values) -> Any:
    match tree:
        case ast.Constant():
            # whole numbers as floats: their powers cannot grow without bound
            return float(tree.value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return values[name] if name in values else _CONSTANTS[name]
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_computed(left, values), _computed(right, values))
        case ast.UnaryOp(operand=operand, op=op):
            return _OPERATORS[type(op)](_computed(operand, values))
        case ast.Call(func=ast.Name(id=name), args=args):
            function = _OF_ONE[name] if name in _OF_ONE else _OF_TWO[name]
            return function(*(_computed(a, values) for a in args))
    raise AssertionError("a tree that was checked holds no more than this")
