"""The notebook about measured records is left out where these are not to be had."""

import os
from pathlib import Path

import pathspec

PAGE = "notebooks/measured_robot.py"
BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data"


def on_config(config):
    if not (Path(os.environ.get("FREQID_DATA", BESIDE)) / "ruler_robot").is_dir():
        for entry in config.nav:
            pages = entry.get("Notebooks", [])
            entry.update(
                {"Notebooks": [p for p in pages if PAGE not in p.values()]} if pages else {}
            )
        excluded = pathspec.gitignore.GitIgnoreSpec.from_lines([PAGE])
        config.exclude_docs = (config.exclude_docs or excluded) + excluded
    return config
