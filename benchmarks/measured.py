"""Error bars, estimators of the response and the measured robot, printed as a table.

    python benchmarks/measured.py            all of it, about three minutes on two cores
    python benchmarks/measured.py --quick    a tenth of the runs

The robot's records are looked for as examples/ruler_robot.py does; that part is left out where they
are missing.
"""

import argparse
import itertools
import sys
import time
from pathlib import Path

import numpy as np
import scipy.signal
from table import show

import freqid as fq

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples"))
import ruler_robot

T1, BAND = 0.5e-3, (10, 80)
PLANT = fq.two_mass()
NAMES = [p.name for p in PLANT.free_parameters]
TRUE = np.array([PLANT[n] for n in NAMES])


def coverage(count):
    """Intervals over many runs of the chirp logged at 2.5 ms; the Cramer-Rao bound beside them."""
    clean = fq.simulate(PLANT, fq.chirp(*BAND, 10, T1), T1).decimate(5)
    std = 0.5
    # the bound of white noise of known variance, transient estimated: of the noise-free Jacobian
    for kind in ("white", "coloured"):
        inside, values, bounds = [], [], []
        for seed in range(count):
            e = np.random.default_rng([seed, 7]).standard_normal(clean.n_samples + 500)
            if kind == "coloured":
                e = scipy.signal.lfilter([0.3], [1, -0.95], e)
            record = fq.Record(clean.u, clean.y + std * e[500:], clean.dt, hold=clean.hold)
            weights = None if kind == "white" else "noise"
            est = fq.fit(PLANT, record, band=BAND, n_starts=1, weights=weights)
            table = est.parameters
            inside.append((table["lower"] <= TRUE) & (table["upper"] >= TRUE))
            values.append(est.values)
            if len(bounds) < 20:
                bounds.append(bound(clean, kind, std))
        share = 100 * np.mean(inside, axis=0)
        show(f"95 % intervals, {kind} noise, {count} runs: least, most",
             f"{share.min():.1f}, {share.max():.1f} %", "94 to 96 %")  # fmt: skip
        ratio = np.var(values, axis=0) / np.diag(np.mean(bounds, axis=0))
        show(f"variance over Cramer-Rao, {kind} noise: least, most",
             f"{ratio.min():.3f}, {ratio.max():.3f}", "1.00 +- 0.05")  # fmt: skip


def bound(clean, kind, std):
    """(Jᵀ S⁻¹ J)⁻¹ at the true parameters with the true spectrum of the noise."""
    from freqid.fitting.cost.objective import Objective
    from freqid.fitting.cost.structures import GreyStructure
    from freqid.fitting.noise_models import GivenWeights
    from freqid.fitting.reading import Reading

    f = np.arange(100, 801) / 10
    power = np.full(701, std**2)
    if kind == "coloured":
        power = power * np.abs(0.3 / (1 - 0.95 * np.exp(-2j * np.pi * f * clean.dt))) ** 2
    experiment = Reading.of(clean, band=BAND, noise=GivenWeights(1 / power)).lines()
    structure = GreyStructure(PLANT)
    point = Objective(structure, [experiment]).point(structure.start)
    J = point.jacobian / structure.scale
    return np.linalg.inv(J.T @ J)


def estimators(count):
    light = light_mode()
    errors = {"lpm": [], "h1": []}
    for seed in range(count):
        record = fq.simulate(light, fq.white_noise(8000, seed=seed), 2e-3)
        record = record.with_noise(0.01 * record.y.std(), seed=seed + 1000)
        for name, frf in (("lpm", fq.local_polynomial(record, band=(15, 25))),
                          ("h1", fq.h1(record, 4000, band=(15, 25)))):  # fmt: skip
            near = np.abs(frf.frequency - 20) <= 0.4
            true = light.frequency_response(frf.omega[near], record.hold).response[0, 0]
            errors[name].append(np.mean(np.abs(frf.response[0, 0, near] - true) ** 2))
    show("local_polynomial over h1 (Hann), mean square at the resonance",
         f"{np.mean(errors['lpm']) / np.mean(errors['h1']):.2f}", "<= 0.33")  # fmt: skip
    for phase in (0, -90):
        record = fq.simulate(PLANT, fq.chirp(*BAND, 10, T1, phase=phase), T1)
        times, bare = [], []
        for _ in range(9):
            # a new record, so that its spectra are not remembered
            again = record.slice(0, 10)
            start = time.perf_counter()
            frf = fq.local_rational(again, band=BAND)
            times.append(time.perf_counter() - start)
            start = time.perf_counter()
            np.fft.rfft(record.u), np.fft.rfft(record.y)
            bare.append(time.perf_counter() - start)
        true = PLANT.frequency_response(frf.omega, record.hold).response
        error = np.sqrt(np.mean(np.abs(frf.response / true - 1) ** 2))
        name = "cosine" if phase == 0 else "sine"
        show(f"local_rational, {name} chirp, noise-free: rms relative error", f"{error:.1e}",
             "<= 3e-5")  # fmt: skip
        show("  time over that of the DFTs of u and y",
             f"{np.median(times) / np.median(bare):.0f}", "<= 200")  # fmt: skip


def light_mode():
    w, zeta = 2 * np.pi * 20, 0.01
    A, B, C = np.array([[0, w], [-w, -2 * zeta * w]]), np.array([[0], [w]]), np.array([[1.0, 0]])
    return fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])


def robot(quick):
    folder = ruler_robot.data_folder()
    if not folder.is_dir():
        print(f"no measured data: {folder} is missing")
        return
    records = [r.detrend() for r in ruler_robot.read_all(folder)]
    worst = 0.0
    halves = list(itertools.combinations(range(10), 5))[: 126 : 15 if quick else 1]
    for half in halves:
        found = []
        for part in (half, [i for i in range(10) if i not in half]):
            modes = ruler_robot.estimate([records[i] for i in part]).modes()
            light = modes[(modes["frequency"] > 10) & (modes["damping"] < 0.5)]
            found.append(light["frequency"].iloc[0])
        worst = max(worst, abs(found[0] / found[1] - 1))
    show(f"robot: mode of five repeats and of the other five, {len(halves)} halves",
         f"{100 * worst:.2f} %", "1 %")  # fmt: skip
    full = ruler_robot.estimate(records)
    table = ruler_robot.decimated(records, full)
    for name, row in table.iterrows():
        target = "<= 2" if name.startswith("remembered") else ""
        show(f"robot: {name}, worst deviation in standard errors", f"{row.abs().max():.1f}", target)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    robot(quick)
    estimators(8 if quick else 40)
    coverage(200 if quick else 2000)
