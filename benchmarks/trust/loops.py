"""Closed loops under several controllers, with noise at their outputs or at their inputs."""

import numpy as np
import pandas as pd

import freqid as fq

from .experiments import PLANTS, Setting

# proportional and integral gains: weak, strong or turned round, and with an integral part
CONTROLLERS = {
    "lag": ((0.3, 0.0), (1.0, 0.0), (0.5, 0.02)),
    "mode": ((0.2, 0.0), (-0.2, 0.0), (0.05, 0.005)),
    "two-mass": ((0.05, 0.0), (0.3, 0.0), (0.1, 0.002)),
}
# where the noise is, the pole that colours it, and its size beside the signal
NOISES = {
    "white sensors, 10 %": ("out", 0.0, 0.1),
    "slow sensors, 10 %": ("out", 0.9, 0.1),
    "slow torques, 10 %": ("in", 0.95, 0.1),
    "slow torques, 30 %": ("in", 0.95, 0.3),
}
CELLS = [(p, c, n) for p, gains in CONTROLLERS.items() for c in range(len(gains)) for n in NOISES]
_SAMPLES = 3000


def _closed(plant, gains, sensor, torque, r):
    """u and y under u(k) = r(k) − kp·y(k) − ki·Σy."""
    model, dt = PLANTS[plant]
    step = model.sampled(fq.ZeroOrderHold(dt))
    A, B, C = step.phi, step.gamma[:, 0], model.state_space().C[0]
    x, total, u, y = np.zeros(len(A)), 0.0, np.zeros(len(r)), np.zeros(len(r))
    for k in range(len(r)):
        y[k] = C @ x + sensor[k]
        total += gains[1] * y[k]
        u[k] = r[k] - gains[0] * y[k] - total
        x = A @ x + B * (u[k] + torque[k])
    return u, y


def one(case):
    """Errors of the default fit in its own standard errors, what its intervals hold, verdict."""
    plant, number, noise = CELLS[case % len(CELLS)]
    seed, gains = case // len(CELLS), CONTROLLERS[plant][number]
    model, dt = PLANTS[plant]
    r = fq.white_noise(_SAMPLES, seed=seed + 7)
    nothing = np.zeros(_SAMPLES)
    u, y = _closed(plant, gains, nothing, nothing, r)
    where, pole, size = NOISES[noise]
    v = Setting(plant, "white", _SAMPLES, pole, 1.0, seed).noise()
    sensor, torque = (size * y.std() * v, nothing) if where == "out" else (
        nothing, size * u.std() * v)  # fmt: skip
    u, y = _closed(plant, gains, sensor, torque, r)
    est = fq.fit(model, fq.Record(u, y, dt, reference=r))
    table = est.parameters
    true = np.array([model[n] for n in table.index])
    z = (table["value"] - true) / table["std"]
    held = (table["lower"] <= true) & (true <= table["upper"])
    return {
        "plant": plant, "controller": f"{gains[0]:g}, {gains[1]:g}", "noise": noise,
        "square": float(np.mean(z**2)), "held": float(held.mean()), "grade": est.verdict.grade,
    }  # fmt: skip


def rows(table: pd.DataFrame):
    """Rows for the printed table: each plant and noise, over its controllers."""
    for (plant, noise), part in table.groupby(["plant", "noise"], sort=False):
        cells = part.groupby("controller", sort=False)
        rms, held = np.sqrt(cells["square"].mean()), 100 * cells["held"].mean()
        trusted = 100 * (part["grade"] == "trust").mean()
        yield (
            f"loop, {plant}, {noise}, {len(part)} runs: rms z, intervals hold, trust",
            f"{rms.min():.2f} to {rms.max():.2f}, {held.min():.0f} to {held.max():.0f}, "
            f"{trusted:.0f} %",
            "1, 95, 97 %",
        )
