"""The tests that run a line which has been changed, the quick ones first."""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path

_TOLD = re.compile(r"^([0-9.]+)s (?:setup|call|teardown)\s+(tests/.*)$", re.MULTILINE)
_FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/\S+)", re.MULTILINE)


def learn(tree, modules, tests, kept):
    """Which tests of a tree run which lines, and for how long, kept as JSON."""
    # pytest-cov leaves its results where coverage's own variable says
    data = kept.with_suffix(".coverage")
    call = [sys.executable, "-m", "pytest", "-q", "-n", "2", "-p", "no:cacheprovider"]
    call += [f"--cov={m}" for m in modules] + ["--cov-context=test", "--cov-report="]
    call += ["-vv", "--durations=0", *tests.split()]
    environment = {**os.environ, "PYTHONPATH": str(tree), "COVERAGE_FILE": str(data)}
    said = subprocess.run(call, cwd=tree, env=environment, capture_output=True, text=True)
    failed = set(_FAILED.findall(said.stdout))
    if said.returncode and not failed:
        raise SystemExit(f"the tests did not run:\n{said.stdout[-3000:]}")
    for name in sorted(failed):
        print(f"fails before anything is changed, and is left out: {name}", flush=True)
    seconds = {}
    for spent, name in _TOLD.findall(said.stdout):
        seconds[name] = seconds.get(name, 0.0) + float(spent)

    from coverage import CoverageData

    ran, lines = CoverageData(str(data)), {}
    ran.read()
    for path in ran.measured_files():
        known = ran.contexts_by_lineno(path)
        own = {n: sorted({c.split("|")[0] for c in names} - failed) for n, names in known.items()}
        lines[str(Path(path).relative_to(tree))] = own
    kept.write_text(
        json.dumps(
            {"seconds": {n: s for n, s in seconds.items() if n not in failed}, "lines": lines}
        )
    )


def _statement(source, line):
    """Lines of the statement around a line, without the body of one that has a body."""
    around = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.stmt) and node.lineno <= line <= node.end_lineno
    ]
    if not around:
        return range(line, line + 1)
    node = max(around, key=lambda n: (n.lineno, -n.end_lineno))
    body = getattr(node, "body", None)
    end = body[0].lineno - 1 if body else node.end_lineno
    return range(node.lineno, max(end, node.lineno) + 1)


def chosen(known, path, source, line, most):
    """Tests that run a line, the quick ones first, of ``most`` seconds together."""
    contexts = known["lines"].get(path, {})
    names = {c for n in _statement(source, line) for c in contexts.get(str(n), ())}
    seconds, own = known["seconds"], names - {""}
    # what is run while modules are imported, any test may notice; those that run it come first
    others = set(seconds) - own if "" in names else set()
    spent, taken = 0.0, []
    for name in sorted(own | others, key=lambda n: (n in others, seconds.get(n, 0.0))):
        spent += seconds.get(name, 0.0)
        if taken and spent > most:
            break
        taken.append(name)
    return taken


def _changed(first, tree, modules):
    """The file and the line in which a tree differs from what it was at first."""
    for module in modules:
        for path in sorted((first / module).rglob("*.py")):
            name = path.relative_to(first)
            was, now = path.read_text(), (tree / name).read_text()
            if was != now:
                pairs = enumerate(zip(was.splitlines(), now.splitlines(), strict=False), 1)
                return str(name), was, next((i for i, (a, b) in pairs if a != b), 1)
    raise SystemExit("nothing is changed")


def main(kept, first, tree, most, *modules):
    """Run the tests that a changed line has; what pytest returns."""
    name, source, line = _changed(Path(first), Path(tree), modules)
    tests = chosen(json.loads(Path(kept).read_text()), name, source, line, float(most))
    if not tests:
        print(f"no test runs {name}:{line}")
        return 0
    named = Path(tree) / "chosen_tests.txt"
    named.write_text("\n".join(tests))
    call = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider"]
    return subprocess.run([*call, f"@{named}"], cwd=tree).returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
