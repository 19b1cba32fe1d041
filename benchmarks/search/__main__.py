"""Every number on the search.

    cd benchmarks; python -m search              all of it: hours, resumed where it was interrupted
    cd benchmarks; python -m search --quick      a hundredth, about five minutes
    cd benchmarks; python -m search witness      one part
    cd benchmarks; python -m search near --first 1000 --out again      other cases

One line of a CSV file a case in ``--out``; delete it to begin anew.
"""

import argparse
from functools import partial
from pathlib import Path

from table import show

from . import minima, orders, responses, speed, store, witness

PARTS = {
    "minima": (minima.one, minima.summary, 5000),
    "near": (partial(minima.one, factor=1.2), minima.summary, 1000),
    "witness": (witness.one, witness.summary, 4000),
    "orders": (orders.one, orders.summary, 100),
    "responses": (responses.one, responses.summary, 500),
    "speed": (speed.one, speed.summary, len(speed.CASES)),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    parser.add_argument("--out", type=Path, default=Path("search_results"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--count", type=int)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    given = parser.parse_args()
    for name in given.parts or PARTS:
        one, summary, count = PARTS[name]
        if given.quick:
            count = max(count // 100, 10)
        # the grid has its cells, whatever cases are drawn for the others
        first = 0 if name == "speed" else given.first
        cases = range(first, first + min(given.count or count, count))
        table = store.resumed(given.out / f"{name}.csv", cases, one)
        for row in summary(table):
            show(*row)
        if name == "speed" and not given.quick:
            print(*speed.grid(table), sep="\n")
            speed.picture(table, given.out / "speed.png")


if __name__ == "__main__":
    main()
