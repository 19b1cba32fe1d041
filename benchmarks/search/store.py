"""Results of a study: one line of a CSV file for each case, so that an interrupted one goes on."""

import csv
from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd


def resumed(path: Path, cases: Iterable[int], one: Callable[[int], dict]) -> pd.DataFrame:
    """Rows of all cases; those that are in the file already are not computed again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    done = pd.read_csv(path) if path.exists() else pd.DataFrame({"case": []})
    known = set(done["case"])
    wanted = list(cases)
    for case in wanted:
        if case in known:
            continue
        row = {"case": case, **one(case)}
        new = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, list(row))
            if new:
                writer.writeheader()
            writer.writerow(row)
    table = pd.read_csv(path)
    return table[table["case"].isin(wanted)]
