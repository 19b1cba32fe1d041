"""Change alarms of fleets: how often without a change, and how much of one they find.

python benchmarks/alarms.py            400 fleets a cell, about ten minutes
python benchmarks/alarms.py --fleets 40
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

import freqid as fq

sys.path.insert(0, str(Path(__file__).parent))
from table import show

# rows; factor that standard errors differ by to both sides, and the scatter beside them
ROWS = (5, 10, 30, 100, 500)
KINDS = {
    "equal errors": (1.0, 0.0), "errors of a factor 3, scatter": (3**0.5, 0.5),
    "errors of a factor 100": (10.0, 0.0), "errors of a factor 100, scatter": (10.0, 1.0),
}  # fmt: skip


def fleet(seed, rows, spread, scatter):
    rng = np.random.default_rng(seed)
    std = spread ** rng.uniform(-1, 1, rows)
    own = std * rng.standard_normal(rows) + scatter * rng.standard_normal(rows)
    return pd.DataFrame({"k": 100 + own, "k_std": std})


def false_alarms(count):
    for rows in ROWS:
        for kind, (spread, scatter) in KINDS.items():
            found = [
                fq.fleet_alarms(fleet([rows, s], rows, spread, scatter), "k").any()
                for s in range(count if rows < 500 else max(count // 4, 1))
            ]
            show(
                f"{rows} rows, {kind}: fleets with an alarm", f"{100 * np.mean(found):.1f} %", "1 %"
            )


def changes(count, rows=60):
    """What is marked of rows after a change, and of those before it."""
    at = np.arange(rows)
    cases = {
        f"step of {size:g} errors at row {begin}": (begin, size * (at >= begin))
        for size in (2, 3, 8, 50)
        for begin in (30, 50, 57)
    }
    cases["drift of 10 errors from row 20"] = (20, 10 * np.clip((at - 20) / 40, 0, 1))
    for name, (begin, change) in cases.items():
        before, after = [], []
        for seed in range(max(count // 8, 5)):
            table = fleet([7, seed], rows, 1.5, 0.0)
            table["k"] += change
            marked = fq.fleet_alarms(table, "k")
            before.append(marked[:begin].mean())
            after.append(marked[begin:].mean())
        told = f"{100 * np.mean(after):.0f} % after, {100 * np.mean(before):.1f} % before"
        show(f"{rows} rows, {name}: rows marked", told)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fleets", type=int, default=400)
    count = parser.parse_args().fleets
    changes(count)
    false_alarms(count)


if __name__ == "__main__":
    main()
