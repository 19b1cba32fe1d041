"""The README's promises: its commands, its Python example, its pictures."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()


def test_the_two_commands_are_those_of_ci():
    script = (ROOT / ".ci" / "run").read_text()
    for command in ("pip install . && freqid reproduce", 'pip install ".[test]" && pytest'):
        assert command in TEXT
        assert command in script


def test_the_python_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = re.search(r"```python\n(.*?)```", TEXT, re.S).group(1)
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)
    assert abs(names["est"]["d"] - 10) < 0.02
    assert names["wrong"]["d"] < -200


def test_the_pictures_exist():
    for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", TEXT):
        assert (ROOT / target).is_file(), target
