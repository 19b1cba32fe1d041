"""A robot from its description file: pinocchio gives the arm's mass matrix, freqid the rest.

python examples/description.py [folder for the pictures]

Needs pinocchio (pip install "freqid[robot]"). The links are those of ``arm.urdf``. What no drawing
tells, joint stiffnesses and dampings, frictions, the motors' inertias and what the tool carries, is
estimated from runs at five postures.
"""

import sys
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin

import freqid as fq

DT, BAND = 2e-3, (1, 80)
TRUE = {
    "load": 8.0,
    "J1": 9.0, "J2": 8.0, "J3": 3.0, "k1": 9e4, "k2": 8e4, "k3": 3e4,
    "d1": 60.0, "d2": 50.0, "d3": 20.0, "f1": 30.0, "f2": 25.0, "f3": 10.0,
}  # fmt: skip
UNITS = {"l": "kg", "J": "kg m²", "k": "N m/rad", "d": "N m s/rad", "f": "N m s/rad"}
POSTURES = [(0.2, 1.2), (0.6, 0.8), (1.0, 0.2), (1.3, 1.6), (-0.4, 2.0)]  # rad: shoulder, elbow

ARM = pin.buildModelFromUrdf(str(Path(__file__).with_name("arm.urdf")))
TOOL = ARM.getFrameId("tool")


@cache
def inertias(q2, q3):
    """Mass matrix of the links at a posture, and what a kilogram at the tool adds to it."""
    data, q = ARM.createData(), np.array([0.0, q2, q3])
    M = pin.crba(ARM, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    J = pin.computeFrameJacobian(ARM, data, q, TOOL, pin.LOCAL_WORLD_ALIGNED)[:3]
    return M, J.T @ J


def mass(J1, J2, J3, load, q2, q3):
    links, tool = inertias(float(q2), float(q3))
    arm = links + load * tool
    zero = np.zeros((3, 3))
    return np.block([[np.diag([J1, J2, J3]), zero], [zero, arm]])


def between(values):
    """Springs or dampers between each motor and its link."""
    D = np.diag(values)
    return np.block([[D, -D], [-D, D]])


def robot():
    """Motors behind flexible joints; gravity is left out, as a constant torque at a posture."""
    return fq.mechanical(
        mass,
        lambda k1, k2, k3: between([k1, k2, k3]),
        lambda d1, d2, d3, f1, f2, f3: between([d1, d2, d3]) + np.diag([f1, f2, f3, 0.0, 0.0, 0.0]),
        B=np.vstack([np.eye(3), np.zeros((3, 3))]),
        C=np.hstack([np.eye(3), np.zeros((3, 3))]),
        measured="velocity",
        parameters=[fq.Parameter(n, v, UNITS[n[0]], lower=0) for n, v in TRUE.items()],
        conditions={"q2": 0.0, "q3": 0.0},
        inputs=["torque 1", "torque 2", "torque 3"],
        outputs=["motor 1", "motor 2", "motor 3"],
        name="arm.urdf",
    )


def runs(noise=0.02):
    """A multisine in each torque at each posture, velocities of the motors with noise."""
    made = []
    for number, (q2, q3) in enumerate(POSTURES):
        u = 100 * fq.multisine((1, 90), 4.0, DT, n_inputs=3, crest="random", seed=number)
        record = fq.simulate(robot().with_conditions(q2=q2, q3=q3), u, DT)
        noisy = record.with_noise(noise * record.y.std(axis=0), seed=number)
        made.append(noisy.with_conditions(q2=q2, q3=q3))
    return made


def main(folder):
    rng = np.random.default_rng(3)
    start = {n: v * (1 + 0.2 * rng.uniform(-1, 1)) for n, v in TRUE.items()}
    est = fq.fit(robot(), runs(), band=BAND, start=start)
    table = est.parameters[["value", "std", "unit"]].assign(true=TRUE)
    table["off / std"] = (table["value"] - table["true"]) / table["std"]
    print(table.to_string(float_format=lambda x: f"{x:.4g}"))
    print(f"verdict: {est.verdict.grade}: {est.verdict.reasons[0]}")
    draw(est).savefig(folder / "description.png")


def draw(est):
    """The turntable's mode with its motor held, over the workspace, in Hz."""
    q2, q3 = np.linspace(-1, 2, 61), np.linspace(-2.4, 2.4, 61)
    first = np.empty((len(q2), len(q3)))
    for i, a in enumerate(q2):
        for j, b in enumerate(q3):
            links, tool = inertias(float(a), float(b))
            seen = links[0, 0] + est["load"] * tool[0, 0]
            first[i, j] = np.sqrt(est["k1"] / seen) / (2 * np.pi)
    figure, ax = plt.subplots(figsize=(6.5, 4.6), layout="constrained")
    drawn = ax.contourf(np.degrees(q3), np.degrees(q2), first, levels=12, cmap="cividis")
    figure.colorbar(drawn, label="turntable's mode, its motor held / Hz")
    for a, b in POSTURES:
        ax.plot(np.degrees(b), np.degrees(a), "o", color="white", markeredgecolor="black")
    ax.set(xlabel="elbow / °", ylabel="shoulder / °", title="From five postures to all of them")
    return figure


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
