"""Coverage of 95 % intervals, and faults against what is said of them."""

import dataclasses
from functools import partial

import numpy as np
from search.plants import random_experiment

import freqid as fq

from .experiments import FAULTS, Setting, measured


def covered(case):
    """One run of one cell: the part of its intervals that hold the truth."""
    cell = list(CELLS)[case % len(CELLS)]
    held = CELLS[cell](case)
    return {"cell": cell, "held": float(np.mean(held)) if len(held) else float("nan")}


def _held(truth, table):
    """Which intervals of a table of parameters hold the truth."""
    return [row["lower"] <= truth[n] <= row["upper"] for n, row in table.iterrows()]


def _drawn(case, pole=0.9, plants=("lag", "mode")):
    s = Setting.drawn(case, plants)
    return Setting(s.plant, s.input, s.samples, pole, s.ratio, s.seed)


def _plain(case, pole=0.9, **options):
    s = _drawn(case, pole)
    return _held(s.model, fq.fit(s.model, measured(s), **options).parameters)


def _prior(case):
    s = _drawn(case)
    name = s.model.free_parameters[0].name
    known = s.model.with_prior(**{name: (s.model[name], 10 * s.model[name])})
    return _held(s.model, fq.fit(known, measured(s)).parameters)


def _bounds(case):
    """A bound half a standard error beside the truth: at it in a third of the runs."""
    s = _drawn(case)
    record = measured(s)
    first = fq.fit(s.model, record).parameters.iloc[0]
    name = s.model.free_parameters[0].name
    low = s.model[name] - 0.5 * first["std"]
    bounded = s.model.with_values(**{name: low + first["std"]}).with_bounds(**{name: (low, np.inf)})
    return _held(s.model, fq.fit(bounded, record).parameters)


def _decimated(case):
    """Every fifth sample under the hold that it remembers, the fast input kept."""
    s = _drawn(case)
    u = np.repeat(s.u(), 5) + 0.3 * fq.white_noise(5 * s.samples, seed=case + 1)
    slow = fq.simulate(s.model, u, s.dt / 5).decimate(5, keep_input=True)
    y = slow.y + slow.y.std() / s.ratio * s.noise()
    return _held(s.model, fq.fit(s.model, dataclasses.replace(slow, y=y)).parameters)


def _periodic(case):
    rng = np.random.default_rng([13, case])
    u = np.tile(fq.multisine((1, 40), 1, 0.01, crest="random", seed=case), 9)
    plant = fq.first_order(b=50.0, a=20.0)
    y = fq.simulate(plant, u, 0.01, hold="bl").y
    noisy = [x + 0.1 * x.std() * rng.standard_normal(len(x)) for x in (u, y)]
    means = fq.periodic(fq.Record(*noisy, 0.01, hold="bl"), 1.0, skip=1)
    return _held(plant, fq.fit(plant, means).parameters)


def _bare(case):
    """A response without variance, the same noise at all of its lines."""
    s = _drawn(case)
    rng = np.random.default_rng([17, case])
    f = np.linspace(0.01, 0.45, 150) / s.dt
    G = s.model.frequency_response(2 * np.pi * f, fq.ZeroOrderHold(s.dt)).response
    noise = rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape)
    G = G + 0.02 * np.sqrt(np.mean(np.abs(G) ** 2)) * noise
    frf = fq.FrequencyResponse(f, G, dt=s.dt, hold=fq.ZeroOrderHold(s.dt))
    return _held(s.model, fq.fit(s.model, frf).parameters)


def _local(case):
    s = _drawn(case)
    s = Setting(s.plant, "white", s.samples, s.pole, s.ratio, s.seed)
    frf = fq.local_rational(measured(s))
    return _held(s.model, fq.fit(s.model, frf, weights="noise").parameters)


def _looped(case):
    s = Setting.drawn(case, ("lag",))
    plain = measured(s, "feedback")
    record = fq.Record(plain.u, plain.y, plain.dt, reference=s.u())
    return _held(s.model, fq.fit(s.model, record).parameters)


def _modes(case):
    """Frequency and damping of a black box's mode, in coloured noise."""
    s = _drawn(case, plants=("mode",))
    s = Setting(s.plant, "white", s.samples, s.pole, s.ratio, s.seed)
    found = fq.fit(fq.OutputError(2), measured(s)).modes()
    if len(found) != 1:
        return [False, False]
    mode = found.iloc[0]
    truth = {"frequency": 40 / (2 * np.pi), "damping": 0.05}
    return [abs(mode[n] - v) <= 1.96 * mode[f"{n}_std"] for n, v in truth.items()]


def _random(case):
    """A random plant of order 1 to 6 in white noise, where the data tell it."""
    plant, record, _, _ = random_experiment(case)
    table = fq.fit(plant, record).parameters
    if not (table["std"] < 0.2 * table["value"].abs()).all():
        return []
    return _held(plant, table)


CELLS = {
    "white": partial(_plain, pole=0.0),
    "AR(0.9)": _plain,
    "weights='noise'": partial(_plain, weights="noise"),
    "domain='time'": partial(_plain, domain="time"),
    "prior": _prior,
    "a bound beside the truth": _bounds,
    "decimated, kept input": _decimated,
    "periodic": _periodic,
    "bare response": _bare,
    "local_rational, weighted": _local,
    "through the reference": _looped,
    "modes of a black box": _modes,
    "random plants that are told": _random,
}  # fmt: skip


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


def good(case):
    """Data without a fault: whether anything is said, and the verdict."""
    s = Setting.drawn(case)
    est = fq.fit(s.model, measured(s))
    return {
        "plant": s.plant, "input": s.input, "pole": s.pole,
        "said": "; ".join(w.kind for w in est.warnings) or "none", "grade": est.verdict.grade,
    }  # fmt: skip


def good_rows(table):
    """Rows for the printed table."""
    said, trusted = (table["said"] != "none").mean(), (table["grade"] == "trust").mean()
    what = f"good data, {len(table)} sets: with any warning; verdict trust"
    yield what, f"{100 * said:.1f} %; {100 * trusted:.1f} %", "1 %; 97 %"


def forced(case):
    """A fit that must not be trusted: in a worse minimum, or of a structure that misses a mode."""
    if case % 2:
        s = Setting.drawn(case)
        est = fq.fit(s.model, measured(s, "another mode"))
        return {"what": "a mode is missed", "worse": True, "grade": est.verdict.grade}
    rng = np.random.default_rng([19, case])
    plant = fq.drivetrain(3) if case % 4 else fq.two_mass()
    names = [p.name for p in plant.free_parameters]
    u = fq.chirp(0.5, 80, 10, 2e-3) if case % 8 < 4 else fq.white_noise(5000, seed=case)
    record = fq.simulate(plant, u, 2e-3)
    record = record.with_noise(0.1 * np.std(record.y), seed=case)
    best = fq.fit(plant, record)
    far = {n: plant[n] * float(np.exp(rng.uniform(-2, 2))) for n in names}
    est = fq.fit(plant.with_values(**far), record, n_starts=1)
    worse = est.cost > 1.001 * best.cost
    return {"what": "a worse minimum", "worse": worse, "grade": est.verdict.grade}


def forced_rows(table):
    """Rows for the printed table."""
    for what, part in table[table["worse"].astype(bool)].groupby("what", sort=False):
        trusted = int((part["grade"] == "trust").sum())
        yield f"{what}, {len(part)} fits: verdict trust", f"{trusted}", "0"


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
