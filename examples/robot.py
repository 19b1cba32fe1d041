"""A three-axis robot with flexible joints, from logs at twelve postures to its stiffnesses.

python examples/robot.py [folder for the picture]

Commands at 1 kHz, sensors at 250 Hz, Coulomb friction in the motors: the axes creep one way, so
that friction is a constant torque, outside of the band. Gravity is left out.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import freqid as fq

H, T, DURATION = 1e-3, 4e-3, 4.0  # s: commands, sensors, each run
BAND = (2, 100)  # Hz
TRUE = {
    "Jm1": 0.30, "Jm2": 0.25, "Jm3": 0.10, "I1": 4.0, "I2": 3.0, "I3": 1.5,
    "k1": 9e3, "k2": 8e3, "k3": 3e3, "d1": 6.0, "d2": 5.0, "d3": 2.0,
    "f1": 2.0, "f2": 2.0, "f3": 1.0, "g1": 3.0, "g2": 2.0, "g3": 1.0,
}  # fmt: skip
UNITS = {"J": "kg m²", "I": "kg m²", "k": "N m/rad", "d": "N m s/rad", "f": "N m s/rad",
         "g": "N m s/rad"}  # fmt: skip
COULOMB = np.array([1.5, 1.5, 0.8])  # N m
CREEP = 0.06  # rad/s: a seventh of a radian over a run, which hardly changes the posture
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


def log(posture, seed, noise=0.02):
    """What one run leaves: stamps and commands at 1 kHz, stamps and velocities at 250 Hz."""
    plant = robot().with_conditions(q2=posture[0], q3=posture[1])
    motor, load = (np.array([TRUE[f"{x}{i}"] for i in (1, 2, 3)]) for x in "fg")
    twist = CREEP * load / np.array([TRUE[f"k{i}"] for i in (1, 2, 3)])
    moving = np.concatenate([twist, np.zeros(3), np.full(6, CREEP)])
    u = 0.1 * fq.multisine((1, 120), DURATION, H, n_inputs=3, crest="random", seed=seed, grid="odd")
    u += CREEP * (motor + load) + COULOMB
    velocity = fq.simulate(plant, u - COULOMB, H, initial_state=moving).y
    assert (velocity > 0).all(), "an axis stands still, where friction is no constant"
    y = velocity[::4]
    rng = np.random.default_rng(1000 + seed)
    y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return H * np.arange(len(u)), u, T * np.arange(len(y)), y


def read(seed=0):
    """The logs of all postures as records that know where they were made."""
    runs = []
    for number, posture in enumerate(POSTURES):
        record = fq.Record.from_logs(*log(posture, 100 * seed + number))
        runs.append(record.with_conditions(q2=posture[0], q3=posture[1]))
    return runs


def slow(record):
    """The same with the commands thinned to the sensors' rate, the hold forgotten."""
    M = record.factor
    return fq.Record(record.u[::M], record.y, record.dt, conditions=record.conditions)


def main(folder):
    runs = read()
    rng = np.random.default_rng(7)
    start = {n: v * (1 + 0.2 * rng.uniform(-1, 1)) for n, v in TRUE.items()}
    est = fq.fit(robot(), runs, band=BAND, start=start)
    table = est.parameters[["value", "std", "unit"]].assign(true=pd.Series(TRUE))
    table["off / std"] = (table["value"] - table["true"]) / table["std"]
    print(table.to_string(float_format=lambda x: f"{x:.4g}"))
    print(f"verdict: {est.verdict.grade}: {est.verdict.reasons[0]}")

    one = fq.fit(robot(), runs[4], band=BAND, start=start, n_starts=1)
    wide = one.parameters["std"] / est.parameters["std"]
    print("\none posture only: error bars wider by")
    print(wide.round(1).to_string())
    for name in one.parameters.index[one.parameters["std"] > 0.5 * one.values]:
        print(f"  {name} is left open")

    thin = fq.fit(robot(), [slow(r) for r in runs], band=(2, 100), start=start, n_starts=1)
    off = (thin.parameters["value"] - pd.Series(TRUE)) / est.parameters["std"]
    print("\nthe decimation ignored (a hold of 4 ms): off by so many standard errors")
    print(off.round(1).to_string())
    draw(est, thin).figure.savefig(folder / "robot.png")


def draw(est, thin):
    """Parameters with their intervals against truth."""
    ax = plt.subplots(figsize=(8, 4.2), layout="constrained")[1]
    x = np.arange(len(TRUE))
    true = np.array(list(TRUE.values()))
    for shift, one, colour, label in (
        (-0.12, est, "#009E73", "the remembered hold of 1 ms"),
        (0.12, thin, "#D55E00", "the decimation ignored"),
    ):
        table = one.parameters
        ax.errorbar(
            x + shift, 100 * (table["value"] / true - 1), 196 * table["std"] / true, fmt="o",
            markersize=4, color=colour, label=label,
        )  # fmt: skip
    ax.axhline(0, color="0.6", linewidth=1, zorder=0)
    ax.set_yscale("symlog", linthresh=3)
    ax.set_xticks(x, list(TRUE))
    ax.set(ylabel="deviation from truth / %", title="Twelve postures, three axes")
    ax.legend(frameon=False)
    return ax


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
