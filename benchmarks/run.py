"""Every number of docs/performance.md, printed as a table.

    python benchmarks/run.py            all of it, about eight minutes on two cores
    python benchmarks/run.py --quick    a tenth of the runs, about a minute

Times are medians; each ratio compares two things timed in turn in this one run.
"""

import argparse
import copy
import sys
import time
from pathlib import Path

import numpy as np
import scipy.linalg

import freqid as fq
from freqid.lti.bases import basis_of
from freqid.lti.responses import points

sys.path.insert(0, str(Path(__file__).parent))
import baseline
from table import show

T1, BAND = 0.5e-3, (10, 80)
PLANT = fq.two_mass()
NAMES = [p.name for p in PLANT.free_parameters]
TRUE = np.array([PLANT[n] for n in NAMES])
ROUNDS = 5


def paired(ours, theirs, count):
    """Median times of two functions, each called ``count`` times running, in turn, in five rounds.

    Not call by call: the threads of BLAS spin for a while after the last product, and would be
    charged to whatever comes next; the pauses let them go to sleep. In rounds, because the clock of
    a shared machine wanders.
    """
    times = {ours: [], theirs: []}
    for _ in range(ROUNDS):
        for function in (ours, theirs):
            time.sleep(0.3)
            function()
            for _ in range(count):
                start = time.perf_counter()
                function()
                times[function].append(time.perf_counter() - start)
    return np.median(times[ours]), np.median(times[theirs])


def chirp(duration=10.0):
    return fq.simulate(PLANT, fq.chirp(*BAND, duration, T1), T1)


def reached(model, record, factor, count, sides=False, **options):
    """Share of starts that reach the best cost to 0.1 %, and the starts tried on average."""
    rng = np.random.default_rng(1)
    names = [p.name for p in model.free_parameters]
    costs, tried = [], []
    for _ in range(count):
        moves = rng.choice([-1, 1], len(names)) if sides else rng.uniform(-1, 1, len(names))
        start = {n: model[n] * factor**m for n, m in zip(names, moves, strict=True)}
        est = fq.fit(model, record, start=start, **options)
        costs.append(est.cost)
        tried.append(est.n_starts)
    costs = np.array(costs)
    energy = np.sum(record.outputs**2)
    return np.mean(costs <= costs.min() * 1.001 + 1e-18 * energy), np.mean(tried)


def starts(count):
    fast = chirp()
    slow = fast.decimate(10)
    for hold in ("zoh", "foh"):
        share, tried = reached(PLANT, slow, 10, count, hold=hold, band=BAND)
        show(
            f"starts: two-mass, decimated, {hold}, factor 10, {count} runs",
            f"{100 * share:.1f} %, {tried:.1f} tried",
            ">= 99.5 %",
        )
    for label, record in (("full rate", fast), ("decimated", slow)):
        share, _ = reached(PLANT, record, 1.5, max(count // 5, 20), sides=True, band=BAND)
        show(f"starts: 1.5 up or down, {label}", f"{100 * share:.1f} %", "100 %")
    three = fq.drivetrain(3)
    record = fq.simulate(three, fq.chirp(2, 100, 10, T1), T1)
    share, tried = reached(three, record, 3, max(count // 4, 20), band=(2, 100))
    show(
        "starts: drivetrain(3), 8 free parameters, full rate, factor 3",
        f"{100 * share:.1f} %, {tried:.1f} tried",
        ">= 98 %",
    )


def kernel():
    omega = 2 * np.pi * np.linspace(*BAND, 701)
    hold = fq.ZeroOrderHold(5e-3)
    lin = PLANT.linearise(PLANT.values, NAMES)
    z = points(omega, hold)
    U = np.ones((1, 1, 701), complex)

    def eigenbasis():
        plant = basis_of(*lin).through(hold)
        inverse = plant.resolvent(z)
        x = plant.solve(z, plant.drive(z, U), inverse)
        return plant.output(x, U), plant.sensitivity(z, plant.output_rows(z, inverse), x, U)

    def block_exponential():
        at, d = lin
        X = np.zeros((4, 4))
        X[:3, :3], X[:3, 3:] = at.A, at.B
        big = np.zeros((5, 8, 8))
        big[:, :4, :4] = big[:, 4:, 4:] = X
        big[:, :3, 4:7], big[:, :3, 7:] = d.A, d.B
        E = scipy.linalg.expm(big * hold.period)
        phi, gamma, dphi, dgamma = E[0, :3, :3], E[0, :3, 3:4], E[:, :3, 4:7], E[:, :3, 7:]
        R = np.linalg.inv(z[:, None, None] * np.eye(3) - phi)
        x, w = R @ gamma, at.C @ R
        return at.C @ x, w @ (dphi[:, None] @ x + dgamma[:, None])

    a, b = eigenbasis(), block_exponential()
    difference = np.abs(a[1][:, 0, 0] - b[1][:, :, 0, 0]).max() / np.abs(a[1]).max()
    ours, theirs = paired(eigenbasis, block_exponential, 100)
    show(
        "kernel: response and five derivatives, 701 lines",
        f"{ours / theirs:.2f} ({1e3 * ours:.2f} ms)",
        "<= 0.25",
    )
    show("kernel: largest difference of the two routes, relative", f"{difference:.0e}", "rounding")


def speed(quick):
    for duration, target in ((10, 10), (100, 30), (1000, 40)):
        record = chirp(duration)
        start = dict(zip(NAMES, 1.2 * TRUE, strict=True))

        def ours(record=record, start=start):
            # as if the record were new: its spectra are not remembered
            return fq.fit(PLANT, copy.copy(record), band=BAND, start=start)

        def theirs(record=record):
            return baseline.grey_box(record.u, record.y, T1, 1.2 * TRUE)

        count = {10: 9, 100: 5, 1000: 3}[duration] if not quick else 1
        mine, other = paired(ours, theirs, count)
        error = np.abs(ours().values / TRUE - 1).max()
        show(
            f"grey box from 20 % off, {len(record.u)} samples, times faster",
            f"{other / mine:.1f} ({1e3 * mine:.1f} ms)",
            f">= {target}; error {error:.0e}",
        )


def hold_estimate(count):
    slow = chirp().decimate(10)
    est = fq.fit(PLANT, slow, hold="estimate", band=BAND)
    worst = max(abs(est[n] / PLANT[n] - 1) for n in NAMES)
    show(
        "hold='estimate', noise-free: period off by",
        f"{100 * abs(est.hold_period / T1 - 1):.3f} %",
        "0.2 %",
    )
    show("hold='estimate', noise-free: worst parameter off by", f"{100 * worst:.2f} %", "0.5 %")
    std = 0.01 * slow.y.std()
    inside = 0
    for seed in range(count):
        noisy = fq.fit(PLANT, slow.with_noise(std, seed=seed), hold="estimate", band=BAND)
        row = noisy.parameters.loc["hold_period"]
        inside += row["lower"] <= T1 <= row["upper"]
    show(
        f"hold='estimate', 1 % noise: 95 % interval holds, {count} runs",
        f"{100 * inside / count:.1f} %",
        "95 +- 2 %",
    )


def black_boxes():
    modes, damping = np.array([20.0, 45, 80, 130]), 0.01
    A = np.zeros((12, 12))
    for i, (w, z) in enumerate([*((w, damping) for w in modes), (10.0, 0.6), (60.0, 0.6)]):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-w * w, -2 * z * w]]
    B = np.tile([[0.0], [1.0]], (6, 1))
    C = np.array([[20, 0, 45, 0, 80, 0, 130, 0, 30, 0, 100, 0]], dtype=float)
    plant = fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])
    u = np.random.default_rng(0).standard_normal(20000)
    record = fq.simulate(plant, u, 0.01)
    record = record.with_noise(0.01 * record.y.std())
    for spec in (fq.OutputError(12), fq.TransferFunction(11, 12)):
        est = fq.fit(spec, record)
        poles = (
            est.to_control().poles() if spec != fq.OutputError(12) else est.to_continuous().poles()
        )
        near = np.array([poles[np.argmin(np.abs(poles - (-damping * w + 1j * w)))] for w in modes])
        show(
            f"order 12, 1 % noise, {type(spec).__name__}: worst mode frequency",
            f"{100 * np.abs(np.abs(near) / modes - 1).max():.4f} %",
            "0.1 %",
        )
        show(
            f"order 12, 1 % noise, {type(spec).__name__}: worst damping",
            f"{100 * np.abs(-near.real / np.abs(near) / damping - 1).max():.2f} %",
            "10 %",
        )
    slow = chirp().decimate(10)

    def ours():
        return fq.fit(fq.OutputError(3), copy.copy(slow), hold="zoh")

    mine, other = paired(ours, lambda: baseline.output_error(slow.u, slow.y), 9)
    show(
        "third-order output error against Steiglitz-McBride + LM",
        f"{mine / other:.1f} times ({1e3 * mine:.1f} ms)",
        "<= 2",
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    kernel()
    speed(quick)
    black_boxes()
    hold_estimate(50 if quick else 500)
    starts(100 if quick else 1000)


if __name__ == "__main__":
    main()
