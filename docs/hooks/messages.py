"""The page of all messages, taken from the code: a search for one's first words finds it."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "freqid"
# a message of fewer letters than this is made of names alone
_LEAST = 12
# functions whose answer is a message
WORDED = ("unknown",)
# what a room's messages are about
ROOMS = {
    "checks.py": "Arguments", "lti": "Holds and sampled plants", "data": "Data and files",
    "excitation": "Excitation", "models": "Models", "frf": "Frequency responses",
    "fitting": "Fits and estimates", "validation": "Validation", "bias": "Bias and design",
    "plots": "Pictures", "paper": "The paper", "pages": "Report and explorer",
    "cli": "Command line",
}  # fmt: skip


def on_page_markdown(markdown: str, page: object, **_: object) -> str:
    """The list in place of its mark."""
    mark = "<!-- messages -->"
    return markdown.replace(mark, listed()) if mark in markdown else markdown


def listed() -> str:
    """A heading for each room, and its errors and warnings in the order of the alphabet."""
    parts = []
    for room, title in ROOMS.items():
        at = PACKAGE / room
        files = [at] if at.is_file() else sorted(at.rglob("*.py"))
        found = {text for file in files for text in messages(file.read_text(encoding="utf-8"))}
        if found:
            lines = sorted(found, key=lambda text: text.lstrip("… ").lower())
            parts += [f"\n## {title}\n", *(f"- `{text}`" for text in lines)]
    return "\n".join(parts)


def messages(source: str) -> Iterator[str]:
    """The words of every error that is raised and every warning that is given."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.name in WORDED:
            yield from (words(n.value) for n in ast.walk(node) if isinstance(n, ast.Return))
        if not isinstance(node, ast.Call) or not node.args:
            continue
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name in ("InputError", "FileNotFoundError", "warn"):
            text = words(node.args[0])
            if len(re.sub(r"[^a-z]", "", text)) >= _LEAST:
                yield text.replace("`", "'")


def words(node: ast.expr) -> str:
    """A message with what is filled in as an ellipsis."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return re.sub(r"…(\s*…)+", "…", "".join(words(part) for part in node.values))
    if isinstance(node, ast.BinOp):
        return words(node.left) + words(node.right)
    return "…"
