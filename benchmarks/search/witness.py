"""Is the witness's p uniform where the model is right, in white and in coloured noise?"""

import numpy as np
import scipy.signal
import scipy.stats

import freqid as fq

MODE = fq.GreyBox(
    lambda w, z, g: ([[0, 1], [-(w**2), -2 * z * w]], [[0], [g * w**2]], [[1, 0]], None),
    [fq.Parameter("w", 40.0), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0)],
)


def one(case):
    """Even cases in white noise, odd ones in AR(0.9) noise: p and verdict."""
    rng = np.random.default_rng([4, case])
    n = int(rng.choice([300, 900, 2500]))
    record = fq.simulate(MODE, rng.standard_normal(n), 0.01)
    noise = rng.standard_normal(n + 200)
    if case % 2:
        noise = scipy.signal.lfilter([1], [1, -0.9], noise)
    y = record.y + rng.choice([0.1, 0.3, 1.0]) * noise[200:] / noise.std()
    witness = fq.fit(MODE, fq.Record(record.u, y, 0.01)).witness
    return {"coloured": case % 2, "p": witness.p_value, "verdict": witness.verdict}


def summary(table):
    """Rows for the printed table."""
    rows = []
    for coloured, name in ((0, "white"), (1, "AR(0.9)")):
        part = table[table["coloured"] == coloured]
        ks = scipy.stats.kstest(part["p"], "uniform").pvalue
        share = 100 * (part["p"] < 0.05).mean()
        complete = 100 * (part["verdict"] == "complete").mean()
        rows += [
            (f"witness, {name}, {len(part)} runs: rejects at 5 %", f"{share:.1f} %", "5 +- 1 %"),
            (f"witness, {name}: Kolmogorov-Smirnov", f"{ks:.3f}", "> 0.01"),
            (f"witness, {name}: says complete", f"{complete:.1f} %", "95 %"),
        ]
    return rows
