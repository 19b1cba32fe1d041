"""Every figure, table and equation of the paper from Python.

python examples/paper.py [folder for the figures]
"""

import sys

import freqid as fq

out = sys.argv[1] if len(sys.argv) > 1 else "out"
print(fq.paper.table2().to_string(index=False))
print(fq.paper.equations().to_string(index=False))
for what, note in fq.paper.NOTES.items():
    print(f"{what}: {note}")
paths = fq.paper.figures(out)
print(f"{len(paths)} files in {out}")
