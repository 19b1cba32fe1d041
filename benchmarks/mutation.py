"""Whether the tests notice when the kernel, the holds, the cost or the search is changed.

    pip install cosmic-ray pytest-cov
    python benchmarks/mutation.py lti --every 10       each tenth change, resumed where it stopped
    python benchmarks/mutation.py lti --report         what survived, as differences

Cosmic Ray changes one operator, number or condition at a time in a copy of the project. The tests
of the rooms are run once beforehand, to learn which of them run which lines; each change is given
to those that run its line, the quick ones first, until one fails or two minutes of them have
passed. Left out: ``|``, which only annotations have here, decorators, and numbers that are limits
of their own (module constants), whose exact value no test may pin.
"""

import argparse
import ast
import collections
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import covering
from table import show

HERE = Path(__file__).resolve().parents[1]
# what is changed, and the tests that may notice
ROOMS = {
    "lti": "freqid/lti",
    "cost": "freqid/fitting/cost",
    "search": "freqid/fitting/search",
}
TESTS = "tests/lti tests/models tests/fitting tests/robots tests/frf tests/bias"
# seconds of tests that a change is given to
_SPENT = 120
# seconds after which a change has made the tests hang
_TIMEOUT = 300
_LEFT_OUT = re.compile(r"core/(ReplaceBinaryOperator_BitOr|RemoveDecorator|ExceptionReplacer)")


def _copied(folder):
    """The files that are kept, in a folder of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    names = subprocess.run(["git", "ls-files"], cwd=HERE, capture_output=True, check=True).stdout
    pack = subprocess.run(
        ["tar", "cf", "-", "-T", "-"], cwd=HERE, input=names, capture_output=True, check=True
    )
    subprocess.run(["tar", "xf", "-"], cwd=folder, input=pack.stdout, check=True)


def _constants(path):
    """Lines of limits: names of a module that are bound to numbers."""
    lines = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            lines.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def _chosen(db, tree, every):
    """Mark all but each so-manieth change as left out."""
    from cosmic_ray.work_item import WorkerOutcome, WorkResult

    limits, skipped, left = {}, [], []
    for item in db.work_items:
        m = item.mutations[0]
        known = limits.setdefault(m.module_path, _constants(tree / m.module_path))
        number = m.operator_name == "core/NumberReplacer" and m.start_pos[0] in known
        keep = not number and not _LEFT_OUT.match(m.operator_name)
        (left if keep else skipped).append((str(m.module_path), m.start_pos, item.job_id))
    left.sort()
    kept = left[every // 2 :: every]
    gone = {job for *_, job in skipped} | {j for *_, j in left} - {j for *_, j in kept}
    db.set_multiple_results(gone, WorkResult(worker_outcome=WorkerOutcome.SKIPPED))
    return len(kept), len(left)


def _told(db, diffs):
    """How many of each module were noticed."""
    count, total = collections.defaultdict(lambda: [0, 0]), [0, 0]
    for item, result in db.completed_work_items:
        if result.test_outcome is None:
            continue
        for tally in (count[item.mutations[0].module_path], total):
            tally[0] += result.is_killed
            tally[1] += 1
        if diffs and not result.is_killed:
            print(result.diff)
    for module, (killed, of) in sorted(count.items()):
        print(f"    {module}: {killed} of {of}")
    return total


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("room", choices=ROOMS)
    parser.add_argument("--every", type=int, default=1, help="take each so-manieth change")
    parser.add_argument("--out", type=Path, default=Path("mutation_results"))
    parser.add_argument("--report", action="store_true", help="print what survived, run nothing")
    given = parser.parse_args()
    from cosmic_ray.work_db import WorkDB

    out, module = given.out.resolve(), ROOMS[given.room]
    tree, first = out / f"{given.room}_tree", out / f"{given.room}_first"
    session, config = out / f"{given.room}.sqlite", out / f"{given.room}.toml"
    known = out / "covering.json"
    if not session.exists() and not given.report:
        _copied(tree)
        _copied(first)
        if not known.exists():
            covering.learn(tree, list(ROOMS.values()), TESTS, known)
        run = [sys.executable, Path(covering.__file__), known, first, tree, _SPENT, module]
        config.write_text(
            f'[cosmic-ray]\nmodule-path = ["{module}"]\ntimeout = {_TIMEOUT}\n'
            f'excluded-modules = []\ntest-command = "{shlex.join(map(str, run))}"\n'
            '[cosmic-ray.distributor]\nname = "local"\n'
        )
        call = ["cosmic-ray", "init", str(config), str(session)]
        subprocess.run(call, cwd=tree, check=True)
        db = WorkDB(session, WorkDB.Mode.open)
        print("changes chosen: {} of {}".format(*_chosen(db, tree, given.every)), flush=True)
    if not given.report:
        environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
        call = ["cosmic-ray", "exec", str(config), str(session)]
        subprocess.run(call, cwd=tree, check=True, env=environment)
    killed, of = _told(WorkDB(session, WorkDB.Mode.open), given.report)
    show(f"{given.room}: noticed of {of} changes", f"{100 * killed / max(of, 1):.1f} %", "90 %")


if __name__ == "__main__":
    main()
