"""Does select_order find the order of fourth-order plants?"""

from functools import partial

import numpy as np

import freqid as fq

from .plants import modal


def one(case):
    """Two modes at least ten half-widths apart, 1 % noise, 2,000 samples of white input."""
    rng = np.random.default_rng([5, case])
    while True:
        w, z = np.sort(10 ** rng.uniform(-0.8, 0.35, 2)), 10 ** rng.uniform(-2.3, -1.3, 2)
        if w[1] - w[0] > 10 * (z * w).max():
            break
    v = {"w0": w[0], "z0": z[0], "w1": w[1], "z1": z[1]}
    v |= {f"g{i}": rng.choice([-1, 1]) * 2 * z[i] * rng.uniform(0.5, 2) for i in (0, 1)}
    plant = fq.GreyBox(
        partial(modal, 0, 2),
        [fq.Parameter(k, x, physical=(-np.inf, np.inf)) for k, x in v.items()],
    )
    clean = fq.simulate(plant, rng.standard_normal(2000), 1.0)
    record = clean.with_noise(0.01 * clean.y.std(), seed=10**6 + case)
    table = fq.select_order(record, range(1, 8))
    return {k: int(table["order"][table[k].idxmin()]) for k in ("mdl", "aic", "cross_validation")}


def summary(table):
    """Rows for the printed table."""
    return [
        (f"order 4 of {len(table)}: {k}", f"{100 * (table[k] == 4).mean():.0f} %", w)
        for k, w in (("mdl", "90 %"), ("cross_validation", ""), ("aic", ""))
    ]
