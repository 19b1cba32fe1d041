"""The README's promises: its commands, its Python example, its pictures."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()


def test_the_two_commands_are_those_of_ci():
    script = (ROOT / ".ci" / "run").read_text()
    for command in ("pip install . && freqid reproduce", 'pip install ".[test]" && pytest'):
        assert command in TEXT
        assert command in script


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.S)


def run(code, tmp_path, monkeypatch):
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)
    return names


def test_the_first_python_example_runs(tmp_path, monkeypatch):
    names = run(blocks("python")[0], tmp_path, monkeypatch)
    assert abs(names["est"]["d"] - 10) < 0.02
    assert names["wrong"]["d"] < -200


def test_the_measured_example_runs_in_fifteen_lines(tmp_path, monkeypatch):
    code = blocks("python")[1]
    assert len([line for line in code.splitlines() if line.strip()]) <= 15
    names = run(code, tmp_path, monkeypatch)
    assert names["c"].fit_percent[0] > 80
    assert (tmp_path / "validation.png").is_file()


def test_the_tutorial_runs(tmp_path, monkeypatch):
    text = (ROOT / "docs" / "index.md").read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    names = run(code, tmp_path, monkeypatch)
    assert names["wrong"]["d"] < -200
    assert names["est"]["d"] == pytest.approx(10, abs=0.1)
    assert names["model"].n_inputs == 1
    assert (tmp_path / "est.html").is_file()


def test_the_three_commands_run(tmp_path):
    (tmp_path / "data").symlink_to(ROOT / "data")
    commands = re.findall(r"^freqid .*chirp_fast.*$", TEXT, re.M)
    assert len(commands) == 3
    for command in commands:
        done = subprocess.run(
            [sys.executable, "-m", "freqid.cli", *shlex.split(command)[1:]],
            capture_output=True, text=True, cwd=tmp_path, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert {"frf.png", "est.json", "validation.png"} <= {p.name for p in tmp_path.iterdir()}


def test_the_pictures_exist():
    for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", TEXT):
        assert (ROOT / target).is_file(), target
