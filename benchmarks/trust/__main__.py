"""Error bars, faults and verdicts.

    cd benchmarks; python -m trust              all of it: hours, resumed where it was interrupted
    cd benchmarks; python -m trust --quick      a twentieth, some minutes
    cd benchmarks; python -m trust faults       one part; its matrix also as a picture in --out

One line of a CSV file a case in ``--out``; delete it to begin anew.
"""

import argparse
from pathlib import Path

from search import store
from table import show

from . import loops, strengths, studies

PARTS = {
    "coverage": (studies.covered, studies.coverage_rows, 2000 * len(studies.CELLS)),
    "loops": (loops.one, loops.rows, 40 * len(loops.CELLS)),
    "forced": (studies.forced, studies.forced_rows, 2000),
    "good": (studies.good, studies.good_rows, 2000),
    "threshold": (strengths.threshold, strengths.rows, 60 * len(strengths.LARGEST)),
    "faults": (studies.named, studies.fault_rows, 200 * len(studies.FAULTS)),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    parser.add_argument("--out", type=Path, default=Path("trust_results"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--count", type=int)
    parser.add_argument("--first", type=int, default=0, help="other cases, as a second run")
    given = parser.parse_args()
    for name in given.parts or PARTS:
        one, summary, count = PARTS[name]
        if given.quick:
            count = max(count // 20, 20)
        cases = range(given.first, given.first + min(given.count or count, count))
        table = store.resumed(given.out / f"{name}.csv", cases, one)
        for row in summary(table):
            show(*row)
        if name == "faults":
            studies.draw(table, given.out / "faults.png")


if __name__ == "__main__":
    main()
