"""Runs every example when the documentation is built, and shows what each prints and draws."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# what a build may lack, whose example then is left out
MISSING = ("no measured data", "No module named 'pinocchio'")


def on_pre_build(config):
    out = ROOT / "docs" / "gallery"
    pages = ["# Gallery", "", "Every example of `examples/`, run when this page was built.", ""]
    for path in sorted((ROOT / "examples").glob("*.py")):
        folder = out / path.stem
        folder.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(
            [sys.executable, str(path), str(folder)], capture_output=True, text=True,
            env={**os.environ, "MPLBACKEND": "agg"}, check=False,
        )  # fmt: skip
        if done.returncode and any(missing in done.stderr for missing in MISSING):
            continue
        if done.returncode:
            raise RuntimeError(f"{path} failed: {done.stderr}")
        title = path.read_text().splitlines()[0].strip('"')
        pages += [f"## {path.stem}", "", title, ""]
        for picture in sorted(folder.rglob("*.png"))[:4]:
            at = picture.relative_to(ROOT / "docs")
            # a wide one is read at its own size
            pages += [f"[![{picture.stem}]({at})]({at})", ""]
        pages += ['??? note "what it prints"', "", "    ```"]
        pages += [f"    {line}" for line in done.stdout.splitlines()[:60]]
        pages += ["    ```", "", '??? note "the script"', "", "    ```python"]
        pages += [f"    {line}" for line in path.read_text().splitlines()]
        pages += ["    ```", ""]
    (ROOT / "docs" / "gallery.md").write_text("\n".join(pages) + "\n")
