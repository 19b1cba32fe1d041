"""Examples run as a user runs them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path, request):
    if path.stem == "ruler_robot":
        request.getfixturevalue("measured")
    if path.stem == "description":
        pytest.importorskip("pinocchio")
    # the other factor, and all postures, have tests of their own
    more = {"ruler_robot": ["10"], "robot": ["4"]}.get(path.stem, [])
    result = subprocess.run(
        [sys.executable, str(path), str(tmp_path), *more],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "MPLBACKEND": "agg"},
    )
    assert result.returncode == 0, result.stderr
    pictures = list(tmp_path.rglob("*.png"))
    assert pictures
    assert all(p.stat().st_size > 5000 for p in pictures)
