"""Does a default fit end in the best minimum, and does it say so where it does not?"""

import time
import warnings

import numpy as np

import freqid as fq

from .plants import moved, random_experiment

# relative cost above the best that is known which counts as worse
WORSE = 1e-3
# no parameter has a larger standard error, relative, where the data determine a plant
DETERMINED = 0.5


def one(case, factor=3.0):
    """A fit from a start within the factor, beside fits from the truth and from thirty."""
    warnings.simplefilter("ignore")
    plant, record, drawn, rng = random_experiment(case)
    start = moved(plant, rng, factor)
    begun = time.perf_counter()
    try:
        est = fq.fit(plant, record, start=start)
    except ValueError as error:
        return {**drawn, **_row(np.nan, np.nan, "error", str(error)[:60], 0, begun)}
    row = _row(est.cost, np.nan, est.witness.verdict, "|".join(str(w)[:40] for w in est.warnings),
               est.n_starts, begun)  # fmt: skip
    true = fq.fit(plant, record)
    row["best"] = min(est.cost, true.cost)
    box = est.witness.cost
    if est.cost > row["best"] * (1 + WORSE) or not est.cost <= box * 1.01:
        other = fq.fit(plant, record, n_starts=30, seed=99)
        row["best"] = min(row["best"], other.cost)
    std = true.parameters["std"] / true.parameters["value"].abs()
    row["spread"] = float(std.max())
    row["own"] = _cost_at(plant.with_values(**start), record)
    return {**drawn, **row}


def _row(cost, best, verdict, said, starts, begun):
    return {
        "cost": cost, "best": best, "own": np.nan, "spread": np.nan, "verdict": verdict,
        "said": said, "starts": starts, "seconds": round(time.perf_counter() - begun, 4),
    }  # fmt: skip


def _cost_at(plant, record):
    """Output error of a plant at its values, the initial state free, independently of the fit."""
    residual = fq.compare(plant, record).residuals
    return float(np.sum(np.asarray(residual) ** 2))


def summary(table):
    """Rows for the printed table: of all plants, and of those whose parameters the data tell."""
    determined = table[table["spread"] < DETERMINED]
    return _rows(table, "") + _rows(determined, "determined: ")


def _rows(table, which):
    right = table["verdict"] != "error"
    worse = right & (table["cost"] > table["best"] * (1 + WORSE))
    above = right & (table["cost"] > table["own"] * (1 + 1e-6))
    silent = worse & (table["verdict"] == "complete")
    complete = (table["verdict"] == "complete")[right & ~worse]
    return [
        (f"{which}worse than the best of {len(table)}", f"{100 * worse.mean():.2f} %", "0.2 %"),
        (f"{which}above their own start", f"{100 * above.mean():.2f} %", "0 %"),
        (f"{which}worse ones called complete", f"{int(silent.sum())}", "0"),
        (f"{which}errors", f"{int((~right).sum())}", ""),
        (f"{which}right ones called complete", f"{100 * complete.mean():.1f} %", "95 %"),
        (f"{which}median, 99 % of the time", f"{1e3 * table['seconds'].median():.0f} ms, "
                                     f"{1e3 * table['seconds'].quantile(0.99):.0f} ms", ""),
    ]  # fmt: skip
