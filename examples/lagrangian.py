"""A two-link arm with flexible joints: from its Lagrangian, by sympy, to its parameters.

python examples/lagrangian.py [folder for the pictures]

Needs sympy (pip install sympy). The energies are written down once; the matrices of motion at any
posture follow, and with them the model, its derivatives and the fit.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import sympy as sp

import freqid as fq

DT, BAND = 1e-3, (1, 60)
# inertias of the links about their joints, their coupling, motors behind gears, joints (SI units)
TRUE = {
    "I1": 1.2, "I2": 0.35, "c": 0.28, "J1": 0.5, "J2": 0.15,
    "k1": 4e3, "k2": 1.2e3, "d1": 2.0, "d2": 0.6, "f1": 1.5, "f2": 0.5,
}  # fmt: skip
UNITS = {"I": "kg m²", "c": "kg m²", "J": "kg m²", "k": "N m/rad", "d": "N m s/rad",
         "f": "N m s/rad"}  # fmt: skip


def matrices_of_motion():
    """M, K and D as functions of the parameters and the posture q2, from T, V and Rayleigh's R."""
    I1, I2, c, J1, J2, k1, k2, d1, d2, f1, f2, q2 = sp.symbols("I1 I2 c J1 J2 k1 k2 d1 d2 f1 f2 q2")
    # motors and links, as they move about the posture
    x = sp.symbols("m1 m2 x1 x2")
    v = sp.symbols("m1_dot m2_dot x1_dot x2_dot")
    motors = J1 * v[0] ** 2 / 2 + J2 * v[1] ** 2 / 2
    both = v[2] + v[3]
    links = I1 * v[2] ** 2 / 2 + I2 * both**2 / 2 + c * sp.cos(q2 + x[3]) * v[2] * both
    kinetic = motors + links
    potential = k1 * (x[2] - x[0]) ** 2 / 2 + k2 * (x[3] - x[1]) ** 2 / 2
    lost = (
        d1 * (v[2] - v[0]) ** 2 / 2 + d2 * (v[3] - v[1]) ** 2 / 2
        + f1 * v[0] ** 2 / 2 + f2 * v[1] ** 2 / 2
    )  # fmt: skip
    at_rest = dict.fromkeys((*x, *v), 0)
    found = []
    for energy, by in ((kinetic, v), (potential, x), (lost, v)):
        matrix = sp.hessian(energy, by).subs(at_rest)
        names = sorted(matrix.free_symbols, key=str)
        found.append(sp.lambdify(names, matrix, "numpy"))
    return found


def arm():
    M, K, D = matrices_of_motion()
    return fq.mechanical(
        M, K, D,
        B=[[1, 0], [0, 1], [0, 0], [0, 0]], C=[[1, 0, 0, 0], [0, 1, 0, 0]], measured="velocity",
        parameters=[fq.Parameter(n, v, UNITS[n[0]], lower=0) for n, v in TRUE.items()],
        conditions={"q2": 0.0}, inputs=["torque 1", "torque 2"], outputs=["motor 1", "motor 2"],
        name="two-link arm",
    )  # fmt: skip


def experiments(model, noise=0.02):
    """Four postures, two orthogonal multisines each, 2 % noise on the motors' velocities."""
    runs = []
    for q2 in (0.3, 1.0, 1.7, 2.4):
        wanted = fq.multisine(
            BAND, 2.0, DT, 2, "random", seed=int(10 * q2), n_inputs=2, orthogonal=True
        )
        for number, u in enumerate(wanted):
            run = fq.simulate(model.with_conditions(q2=q2), 20 * u, DT)
            size = noise * run.y.std(axis=0)
            runs.append(run.with_noise(size, seed=int(100 * q2) + number).with_conditions(q2=q2))
    return runs


def main(out):
    model = arm()
    runs = experiments(model)
    start = {n: v * f for (n, v), f in zip(TRUE.items(), [0.7, 1.4] * 6, strict=False)}
    # each motor, at each posture, has noise of its own
    est = fq.fit(model, runs, band=BAND, start=start, weights="noise")
    table = est.parameters.assign(true=TRUE)
    print(table[["true", "value", "std", "lower", "upper", "unit"]].to_string())
    print(est.verdict)

    frf = fq.periodic(runs[:2], period=2.0, band=BAND)
    model = est.model.with_conditions(q2=0.3)
    seen = model.frequency_response(frf.omega, fq.ZeroOrderHold(DT))
    labels = ["measured at q2 = 0.3 rad", "estimated from four postures"]
    axes = fq.bode(*(first_motor(r) for r in (frf, seen)), labels=labels, unit="Hz")
    axes[0].set_title("torque 1 to motor 1")
    axes[0].figure.savefig(out / "lagrangian_bode.png", dpi=120)
    plt.close("all")


def first_motor(frf):
    """What the first torque does to the first motor."""
    variance = None if frf.variance is None else frf.variance[0, 0]
    return fq.FrequencyResponse(
        frf.frequency, frf.response[0, 0], dt=DT, hold=fq.ZeroOrderHold(DT), variance=variance
    )


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    folder.mkdir(parents=True, exist_ok=True)
    main(folder)
