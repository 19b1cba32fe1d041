"""The house: rooms, doors, one direction, and how long a file may be."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import freqid as fq

PACKAGE = Path(fq.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
LAYERS = [
    "lti", "data", "excitation", "models", "frf", "fitting", "validation", "bias", "plots",
    "paper", "pages", "cli",
]  # fmt: skip


def imports(path):
    """(module, names, at the top of the file) of every import of the package's own."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("freqid."):
            yield node.module, [a.name for a in node.names], node in tree.body


def room(path):
    return path.relative_to(PACKAGE).parts[0]


def test_few_names_stand_at_the_door():
    names = [p.name for p in PACKAGE.iterdir() if p.name != "__pycache__"]
    assert len(names) <= 16, sorted(names)
    assert {p.name for p in PACKAGE.iterdir() if p.is_dir()} - {"__pycache__"} == set(LAYERS)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_a_file_is_one_idea(path):
    assert len(path.read_text().splitlines()) <= 300
    assert ast.get_docstring(ast.parse(path.read_text()))


def test_rooms_are_entered_by_their_doors():
    """Others import a name from the package, not from the file in which it happens to stand."""
    deep = [
        (str(path.relative_to(PACKAGE)), module)
        for path in FILES
        for module, names, _ in imports(path)
        if module.count(".") > 1 and module.split(".")[1] != room(path)
    ]
    assert not deep


def test_imports_go_one_way():
    """The contract of import-linter, said again without it; methods that reach up are lazy."""
    order = {name: i for i, name in enumerate(LAYERS)}
    for path in FILES:
        own = order.get(room(path), -1)
        for module, _, at_top in imports(path):
            other = order.get(module.split(".")[1], -1)
            assert other <= own or not at_top, f"{path} imports {module}"


def test_no_circle_between_files():
    graph = {}
    for path in FILES:
        name = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        own = "freqid." + room(path)
        # a room's door imports its files: what they import of one another must have no circle
        graph[name.removesuffix(".__init__")] = {
            module
            for module, _, at_top in imports(path)
            if at_top and module.startswith(own) and not name.endswith("__init__")
        }
    done, path = set(), []

    def visit(name):
        assert name not in path, " -> ".join([*path, name])
        if name in done or name not in graph:
            return
        path.append(name)
        for other in graph[name]:
            visit(other)
        path.pop()
        done.add(name)

    for name in graph:
        visit(name)


def test_no_module_is_called_like_a_public_function():
    modules = {p.stem for p in FILES if p.stem != "__init__"}
    functions = {n for n in fq.__all__ if callable(getattr(fq, n)) and not n[0].isupper()}
    assert not modules & functions


def test_the_front_is_clean_and_lazy():
    assert set(dir(fq)) == set(fq.__all__)
    assert set(LAYERS) <= set(dir(fq))
    assert not [n for n in dir(fq) if n.startswith("_") and n != "__version__"]
    code = (
        "import freqid, sys; print([m for m in ('numpy', 'scipy', 'pandas') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_a_command_starts_without_what_it_may_not_need():
    """scipy.signal and scipy.stats took two of three seconds of every command."""
    code = (
        "import sys, freqid.cli.commands; "
        "print([m for m in ('scipy.signal', 'scipy.stats', 'matplotlib', 'pandas', 'control') "
        "if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_signatures_say_what_they_take():
    count = 0
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef):
                continue
            a = node.args
            given = [*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg]
            annotations = [x.annotation for x in given if x is not None and x.annotation]
            annotations += [node.returns] if node.returns else []
            for annotation in annotations:
                names = (n.id for n in ast.walk(annotation) if isinstance(n, ast.Name))
                count += sum(name == "Any" for name in names)
    assert count <= 60


def documented(thing):
    """Names that a docstring lists under Args, and its whole text."""
    text = thing.__doc__ or ""
    block = re.search(r"Args:\n(.*?)(\n\s*\n|\Z)", text, re.S)
    lines = block[1].splitlines() if block else []
    indent = min((len(x) - len(x.lstrip()) for x in lines if x.strip()), default=0)
    heads = [x.strip() for x in lines if len(x) - len(x.lstrip()) == indent and ": " in x]
    return {name.strip() for h in heads for name in h.split(": ")[0].split(",")}, text


PUBLIC = [n for n in fq.__all__ if callable(getattr(fq, n))]


@pytest.mark.parametrize("name", PUBLIC)
def test_docstrings_and_signatures_agree(name):
    import inspect

    thing = getattr(fq, name)
    listed, text = documented(thing)
    parameters = list(inspect.signature(thing).parameters)
    assert listed <= set(parameters), f"{name} documents {listed - set(parameters)}"
    if re.search(r"as in ``|Takes what ``|[Aa]rguments.* as in", text):
        return
    silent = [p for p in parameters if not re.search(rf"\b{p}s?\b", text) and p != "ax"]
    assert not silent, f"{name} says nothing of {silent}"


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_explained(name):
    assert len((getattr(fq, name).__doc__ or "").strip()) > 20
