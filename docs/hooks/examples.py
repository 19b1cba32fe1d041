"""Docstrings whose doctests stand in a section of their own, as the API pages want them.

Without one Markdown takes ``>>>`` for a quotation within a quotation within a quotation.
"""

import ast
from typing import Any

import griffe


class Examples(griffe.Extension):
    """Puts a heading over each run of doctest lines that has none."""

    def on_instance(self, *, node: ast.AST | griffe.ObjectNode, obj: griffe.Object,
                    agent: griffe.Visitor | griffe.Inspector, **kwargs: Any) -> None:  # fmt: skip
        """For every function, class and property."""
        if obj.docstring is not None:
            obj.docstring.value = with_heading(obj.docstring.value)


def with_heading(text: str) -> str:
    """The docstring with ``Examples:`` over its doctests, and these indented below it."""
    lines, out, inside = text.split("\n"), [], False
    for number, line in enumerate(lines):
        before = lines[number - 1].strip() if number else ""
        if line.startswith(">>>") and not inside and not before:
            out += ["Examples:"]
            inside = True
        elif inside and not before and line.strip() and not line.startswith(">>>"):
            # a paragraph after the example
            inside = False
        out.append(f"    {line}" if inside and line.strip() else line)
    return "\n".join(out)
