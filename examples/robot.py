"""A three-axis robot with flexible joints, from logs at twelve postures to its stiffnesses.

python examples/robot.py [folder for the pictures] [number of postures, 12]

Velocity loops, commands at 1 kHz, sensors at 250 Hz, torques that disturb, Coulomb friction in the
motors: the axes creep one way, so that friction is a constant torque, outside of the band. Gravity
is left out.
"""

import sys
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import scipy.signal

import freqid as fq

H, T = 1e-3, 4e-3  # s: commands, sensors
PERIOD, PERIODS = 2.0, 5  # s, of the excitation, the first of which the transient spoils
BAND = (2, 100)  # Hz
NOISE = 0.014  # of each velocity: as much of the sensor as of the torques, 2 % together
GAIN = np.diag([120.0, 120.0, 45.0])  # N m s/rad, of the velocity loops
TRUE = {
    "Jm1": 0.30, "Jm2": 0.25, "Jm3": 0.10, "I1": 4.0, "I2": 3.0, "I3": 1.5,
    "k1": 9e3, "k2": 8e3, "k3": 3e3, "d1": 6.0, "d2": 5.0, "d3": 2.0,
    "f1": 2.0, "f2": 2.0, "f3": 1.0, "g1": 3.0, "g2": 2.0, "g3": 1.0,
}  # fmt: skip
UNITS = {"J": "kg m²", "I": "kg m²", "k": "N m/rad", "d": "N m s/rad", "f": "N m s/rad",
         "g": "N m s/rad"}  # fmt: skip
COULOMB = np.array([1.5, 1.5, 0.8])  # N m
CREEP = 0.015  # rad/s: a seventh of a radian over a run, which hardly changes the posture
POSTURES = [(q2, q3) for q2 in (-1.0, 0.0, 0.5, 1.2) for q3 in (-1.2, 0.2, 1.0)]


def arm(I1, I2, I3, q2, q3):
    """Mass matrix of the arm at a posture (rad): a base that turns, an upper arm, a forearm."""
    M = np.zeros((3, 3), np.result_type(I1, I2, I3))
    c = 0.4 * I3  # how far the forearm's mass lies from its joint is known
    M[0, 0] = I1 + I2 * np.cos(q2) ** 2 + I3 * np.cos(q2 + q3) ** 2
    M[1, 1] = I2 + I3 + 2 * c * np.cos(q3)
    M[1, 2] = M[2, 1] = I3 + c * np.cos(q3)
    M[2, 2] = I3
    return M


def mass(Jm1, Jm2, Jm3, I1, I2, I3, q2, q3):
    zero = np.zeros((3, 3))
    return np.block([[np.diag([Jm1, Jm2, Jm3]), zero], [zero, arm(I1, I2, I3, q2, q3)]])


def between(values):
    """Springs or dampers between each motor and its arm."""
    D = np.diag(values)
    return np.block([[D, -D], [-D, D]])


def stiffness(k1, k2, k3):
    return between([k1, k2, k3])


def damping(d1, d2, d3, f1, f2, f3, g1, g2, g3):
    return between([d1, d2, d3]) + np.diag([f1, f2, f3, g1, g2, g3])


def robot():
    return fq.mechanical(
        mass,
        stiffness,
        damping,
        B=np.vstack([np.eye(3), np.zeros((3, 3))]),
        C=np.hstack([np.eye(3), np.zeros((3, 3))]),
        measured="velocity",
        parameters=[fq.Parameter(n, v, UNITS[n[0]], lower=0) for n, v in TRUE.items()],
        conditions={"q2": 0.0, "q3": 0.0},
        inputs=["torque 1", "torque 2", "torque 3"],
        outputs=["motor 1", "motor 2", "motor 3"],
        name="three axes",
    )


def loop(plant):
    """The sampled loop around a robot: torques added to the commands, torques that disturb and
    noise of the sensors in, velocities and commands out.
    """
    A, B, C, D = control.ssdata(control.c2d(plant.to_control(), H))
    one, none = np.eye(3), np.zeros((3, 3))
    return control.ss(
        A - B @ GAIN @ C,
        np.hstack([B, B, -B @ GAIN]),
        np.vstack([C, -GAIN @ C]),
        np.block([[D, D, none], [one, none, -GAIN]]),
        H,
    )


def excitation(seed):
    """Torques added to the commands, (runs, samples, axes): a run for each axis."""
    period = 0.05 * fq.multisine(
        (1, 120), PERIOD, H, n_inputs=3, orthogonal=True, grid="odd", crest="random", seed=seed
    )
    return np.tile(period, (1, PERIODS, 1))


def logs(posture, seed):
    """What the runs at a posture leave: stamps and commands at 1 kHz, stamps and velocities at
    250 Hz.
    """
    plant = robot().with_conditions(q2=posture[0], q3=posture[1])
    motor, load = (np.array([TRUE[f"{x}{i}"] for i in (1, 2, 3)]) for x in "fg")
    moving = loop(plant)
    rng = np.random.default_rng(1000 + seed)
    for r in excitation(seed):
        none = np.zeros_like(r)
        size = fq.simulate(moving, np.hstack([r, none, none]), H).y[:, :3].std(axis=0)
        ripple = scipy.signal.lfilter([1], [1, -0.98], rng.standard_normal(r.shape), axis=0)
        felt = fq.simulate(moving, np.hstack([none, ripple, none]), H).y[:, :3].std(axis=0)
        ripple, sensor = ripple * NOISE * size / felt, NOISE * size * rng.standard_normal(r.shape)
        both = fq.simulate(moving, np.hstack([r, ripple, sensor]), H).y
        velocity, u = CREEP + both[:, :3], both[:, 3:] + CREEP * (motor + load) + COULOMB
        assert (velocity > 0).all(), "an axis stands still, where friction is no constant"
        y = (velocity + sensor)[::4]
        yield H * np.arange(len(u)), u, T * np.arange(len(y)), y


def read(seed=0, postures=POSTURES):
    """The logs of postures as records that know where they were made, three at each."""
    runs = []
    for number, (q2, q3) in enumerate(postures):
        each = (fq.Record.from_logs(*log) for log in logs((q2, q3), 100 * seed + number))
        runs.append([record.with_conditions(q2=q2, q3=q3) for record in each])
    return runs


def responses(runs, seed=0):
    """The response at each posture, with the noise of commands and velocities over the periods.

    What was added to the commands tells which lines are excited, also where the loop hides it.
    """
    made = []
    for number, three in enumerate(runs):
        added = list(excitation(100 * seed + number)[:, ::4])
        made.append(fq.periodic(three, PERIOD, added, skip=1, band=BAND))
    return made


def slow(record):
    """The same with the commands thinned to the sensors' rate, the hold forgotten."""
    M = record.factor
    return fq.Record(record.u[::M], record.y, record.dt, conditions=record.conditions)


def start(seed=7):
    """Values that are wrong by up to 20 %."""
    rng = np.random.default_rng(seed)
    return {n: v * (1 + 0.2 * rng.uniform(-1, 1)) for n, v in TRUE.items()}


def off(est, unit=None):
    """Deviations from truth in standard errors, the estimate's own or those of ``unit``."""
    std = (est if unit is None else unit).parameters["std"]
    return (est.parameters["value"] - pd.Series(TRUE)) / std


def main(folder, count=12):
    chosen = np.linspace(0, len(POSTURES) - 1, count).round().astype(int)
    runs = read(postures=[POSTURES[i] for i in chosen])
    frfs = responses(runs)
    est = fq.fit(robot(), frfs, start=start())
    table = est.parameters[["value", "std", "unit"]].assign(true=pd.Series(TRUE))
    table["off / std"] = off(est)
    print(table.to_string(float_format=lambda x: f"{x:.4g}"))
    print(f"verdict: {est.verdict.grade}: {est.verdict.reasons[0]}")

    number = len(frfs) // 3
    one = fq.fit(robot(), frfs[number], start=start(), n_starts=1)
    wide = one.parameters["std"] / est.parameters["std"]
    print("\none posture only: error bars wider by")
    print(wide.round(1).to_string())
    for name in one.parameters.index[one.parameters["std"] > 0.5 * one.values]:
        print(f"  {name} is left open")

    some = [record for three in runs[::3] for record in three]
    direct = fq.fit(robot(), some, band=BAND, start=start(), n_starts=1, reference=False)
    few = len(runs[::3])
    print(
        f"\nthe loop ignored, each record by itself, {few} postures: off by so many standard errors"
    )
    print(off(direct).round(1).to_string())
    print(f"verdict: {direct.verdict.grade}: {direct.verdict.reasons[0]}")

    thinned = responses([[slow(record) for record in three] for three in runs])
    near = est.parameters["value"].to_dict()
    thin = fq.fit(robot(), thinned[::3], start=near, n_starts=1)
    print(
        f"\nthe decimation ignored (a hold of 4 ms), {few} postures: off by so many standard errors"
    )
    print(off(thin, est).round(1).to_string())
    draw(est, thin, len(frfs), few).figure.savefig(folder / "robot.png")
    draw_responses(est, frfs).savefig(folder / "robot_responses.png")


def draw(est, thin, count, few):
    """Parameters with their intervals against truth."""
    ax = plt.subplots(figsize=(8, 4.2), layout="constrained")[1]
    x = np.arange(len(TRUE))
    true = np.array(list(TRUE.values()))
    for shift, one, colour, label in (
        (-0.12, est, "#009E73", "the remembered hold of 1 ms"),
        (0.12, thin, "#D55E00", f"the decimation ignored, {few} postures"),
    ):
        table = one.parameters
        ax.errorbar(
            x + shift, 100 * (table["value"] / true - 1), 196 * table["std"] / true, fmt="o",
            markersize=4, color=colour, label=label,
        )  # fmt: skip
    ax.axhline(0, color="0.6", linewidth=1, zorder=0)
    ax.set_yscale("symlog", linthresh=3)
    ax.set_xticks(x, list(TRUE))
    ax.set(ylabel="deviation from truth / %", title=f"{count} postures, three axes")
    ax.legend(frameon=False)
    return ax


def draw_responses(est, frfs):
    """From each torque to each motor: the model's range over the postures, and one as measured."""
    f = np.geomspace(*BAND, 400)
    hold = fq.ZeroOrderHold(H)
    models = [
        np.abs(est.model.with_conditions(**frf.conditions)
               .frequency_response(2 * np.pi * f, hold).response)
        for frf in frfs
    ]  # fmt: skip
    figure, grid = plt.subplots(
        3, 3, figsize=(9, 7), sharex=True, sharey=True, layout="constrained"
    )
    number = len(frfs) // 3
    one = frfs[number]
    for (i, j), ax in np.ndenumerate(grid):
        each = np.array([m[i, j] for m in models])
        if each.max() > 1e-9:
            low, high = each.min(axis=0), each.max(axis=0)
            ax.fill_between(f, low, high, color="#56B4E9", alpha=0.4, linewidth=0)
            ax.loglog(f, each[number], color="#0072B2", linewidth=1.2)
        measured = np.abs(one.response[i, j])
        ax.loglog(one.frequency, measured, ".", color="#D55E00", markersize=3)
        ax.set(xlim=BAND, ylim=(2e-5, 1))
        if i == 0:
            ax.set_title(f"torque {j + 1}", fontsize="medium")
        if j == 0:
            ax.set_ylabel(f"motor {i + 1}\nrad/s per N m")
        if i == 2:
            ax.set_xlabel("frequency / Hz")
    figure.suptitle(f"{len(frfs)} postures: range of the model, and one as measured (dots)")
    return figure


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    out.mkdir(parents=True, exist_ok=True)
    main(out, *(int(n) for n in sys.argv[2:]))
