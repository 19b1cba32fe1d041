"""Coverage of 95 % intervals, and faults against what is said of them."""

import numpy as np

import freqid as fq

from .experiments import FAULTS, Setting, measured

CELLS = ("white", "AR(0.9)", "weights='noise'", "prior", "domain='time'", "periodic",
         "through the reference")  # fmt: skip


def covered(case):
    """One run of one cell: the part of its intervals that hold the truth."""
    cell = CELLS[case % len(CELLS)]
    looped = cell == "through the reference"
    s = Setting.drawn(case, ("lag",) if looped or cell == "periodic" else ("lag", "mode"))
    truth, options, model = s.model, {}, s.model
    if cell == "periodic":
        data = _periodic(case)
    elif looped:
        plain = measured(s, "feedback")
        data = fq.Record(plain.u, plain.y, plain.dt, reference=s.u())
    else:
        pole = 0.0 if cell == "white" else 0.9
        data = measured(Setting(s.plant, s.input, s.samples, pole, s.ratio, s.seed))
    if cell == "weights='noise'":
        options = {"weights": "noise"}
    elif cell == "domain='time'":
        options = {"domain": "time"}
    elif cell == "prior":
        name = truth.free_parameters[0].name
        model = truth.with_prior(**{name: (truth[name], 10 * truth[name])})
    table = fq.fit(model, data, **options).parameters
    held = [row["lower"] <= truth[n] <= row["upper"] for n, row in table.iterrows()]
    return {"cell": cell, "held": float(np.mean(held))}


def _periodic(case):
    rng = np.random.default_rng([13, case])
    u = np.tile(fq.multisine((1, 40), 1, 0.01, crest="random", seed=case), 9)
    y = fq.simulate(fq.first_order(b=50.0, a=20.0), u, 0.01, hold="bl").y
    noisy = [x + 0.1 * x.std() * rng.standard_normal(len(x)) for x in (u, y)]
    return fq.periodic(fq.Record(*noisy, 0.01, hold="bl"), 1.0, skip=1)


def coverage_rows(table):
    """Rows for the printed table."""
    for cell, part in table.groupby("cell", sort=False):
        yield (
            f"95 % intervals, {cell}, {len(part)} runs",
            f"{100 * part['held'].mean():.1f} %",
            ("93 to 97 %"),
        )


def named(case):
    """One fault in one experiment: the first thing said, and the verdict."""
    fault = FAULTS[case % len(FAULTS)]
    s = Setting.drawn(case, ("lag",) if fault == "feedback" else ("lag", "mode", "two-mass"))
    est = fq.fit(s.model, measured(s, fault))
    kinds = [w.kind for w in est.warnings]
    return {
        "fault": fault, "plant": s.plant, "input": s.input, "pole": s.pole,
        "first": kinds[0] if kinds else "none", "named": fault in kinds,
        "grade": est.verdict.grade,
    }  # fmt: skip


def matrix(table):
    """Faults against the first thing said, in per cent."""
    counts = table.groupby(["fault", "first"]).size().unstack(fill_value=0)
    share = 100 * counts.div(counts.sum(axis=1), axis=0)
    columns = [f for f in FAULTS if f in share] + [f for f in share if f not in FAULTS]
    return share.reindex([f for f in FAULTS if f in share.index])[columns]


def fault_rows(table):
    """Rows for the printed table, and the matrix under them."""
    for fault, part in table.groupby("fault", sort=False):
        right = 100 * (part["first"] == fault).mean()
        trusted = 100 * (part["grade"] == "trust").mean()
        what = f"{fault}, {len(part)} runs: first sentence right; verdict trust"
        wanted = "99; 97 %" if fault == "none" else "80 %; few"
        yield what, f"{right:.0f} %; {trusted:.0f} %", wanted
    print(matrix(table).round(0).astype(int).to_string())


def draw(table, path):
    """The matrix as a picture."""
    import matplotlib.pyplot as plt

    share = matrix(table)
    fig, ax = plt.subplots(figsize=(8.5, 5.2), layout="constrained")
    image = ax.imshow(share, cmap="Blues", vmin=0, vmax=100, aspect="auto")
    ax.set_xticks(range(len(share.columns)), share.columns, rotation=40, ha="right")
    ax.set_yticks(range(len(share.index)), share.index)
    for (i, j), value in np.ndenumerate(share.to_numpy()):
        if value >= 0.5:
            ax.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize=8,
                    color="white" if value > 55 else "black")  # fmt: skip
    ax.set_xlabel("first thing said")
    ax.set_ylabel("fault in the data")
    fig.colorbar(image, label="% of runs")
    fig.savefig(path, dpi=150)
