"""The robot of the example over seeds: each stiffness within its interval, and within 3 %.

python -m robot [seeds]        from this folder; ten seeds take about a minute
"""

import sys
from pathlib import Path

import numpy as np

import freqid as fq

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
import robot as example

STIFFNESSES = ["k1", "k2", "k3"]


def one(seed):
    """Deviations of all parameters in standard errors, and of the stiffnesses as they are."""
    frfs = example.responses(example.read(seed), seed)
    est = fq.fit(example.robot(), frfs, start=example.start(seed))
    table = est.parameters
    true = np.array([example.TRUE[n] for n in table.index])
    inside = ((table["lower"] <= true) & (true <= table["upper"]))[STIFFNESSES]
    worst = max(abs(est[n] / example.TRUE[n] - 1) for n in STIFFNESSES)
    return example.off(est).to_numpy(), inside.to_numpy(), worst, est.verdict.grade


def main(seeds):
    """Print a row a seed, and what they have in common."""
    found = []
    print("seed  stiffnesses in their interval  worst off by / %  rms deviation / std  verdict")
    for seed in range(seeds):
        found.append(one(seed))
        off, inside, worst, grade = found[-1]
        rms = np.sqrt((off**2).mean())
        print(f"{seed:4}  {inside.sum():29}  {100 * worst:16.3f}  {rms:19.2f}  {grade}", flush=True)
    every = np.array([f[0] for f in found])
    print(f"all three inside: {sum(f[1].all() for f in found)} of {seeds} seeds")
    print(f"intervals that hold: {np.mean(np.abs(every) < 1.96):.1%} of {every.size}")
    print(f"rms deviation / std: {np.sqrt((every**2).mean()):.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
