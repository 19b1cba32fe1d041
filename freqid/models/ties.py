"""Parameters tied to expressions of others: ``{"Ja": "2 * Jm"}``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import asteval
import numpy as np

from freqid.checks import InputError, unknown


@cache
def _interpreter() -> asteval.Interpreter:
    return asteval.Interpreter(minimal=True, use_numpy=True)


class Ties:
    """Expressions by the name of the parameter that follows them.

    Expressions are arithmetic and numpy functions of the other parameters; they are evaluated
    without access to Python itself, and carry complex numbers and arrays through. Raises ValueError
    for unknown names, for a tie to a tied parameter, and for what cannot be computed.
    """

    def __init__(self, expressions: Mapping[str, str], names: Sequence[str]) -> None:
        self.expressions = dict(expressions)
        self._parsed: dict[str, Any] = {}
        for name, text in self.expressions.items():
            if name not in names:
                raise InputError(unknown("ties", name, names))
            try:
                node = _interpreter().parse(text)
            except (SyntaxError, TypeError):
                _interpreter().error = []
                raise InputError(
                    f"tie {name}={text!r} is not an expression; expected one like '2 * Jm'"
                ) from None
            for other in asteval.get_ast_names(node):
                if other in self.expressions:
                    raise InputError(f"tie {name}={text!r} refers to {other}, which is tied itself")
                if other not in names and other not in _interpreter().symtable:
                    raise InputError(f"tie {name}={text!r}: {unknown('parameter', other, names)}")
            self._parsed[name] = node

    def resolve(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values (numbers or arrays) with the tied ones computed from the others."""
        resolved = dict(values)
        if not self._parsed:
            return resolved
        interpreter = _interpreter()
        for name, node in self._parsed.items():
            free = {n: v for n, v in values.items() if n not in self._parsed}
            kept = {n: interpreter.symtable[n] for n in free if n in interpreter.symtable}
            interpreter.symtable.update(free)
            try:
                resolved[name] = interpreter.run(node, with_raise=False)
                errors, interpreter.error = interpreter.error, []
            finally:
                for n in free:
                    interpreter.symtable.pop(n, None)
                interpreter.symtable.update(kept)
            if errors or resolved[name] is None:
                raise InputError(f"tie {name}={self.expressions[name]!r} cannot be computed")
            if np.ndim(resolved[name]) == 0 and not np.iscomplexobj(resolved[name]):
                resolved[name] = float(resolved[name])
        return resolved
