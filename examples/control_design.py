"""From a decimated record to a closed loop: identify with freqid, design with python-control.

python examples/control_design.py [folder for the pictures]
"""

import sys
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import freqid as fq

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)

# the axis, identified from a record that was decimated by 10
plant, dt = fq.two_mass(), 0.5e-3
record = fq.simulate(plant, fq.chirp(10, 80, 10, dt), dt).with_noise(0.2, seed=1).decimate(10)
models = {
    "remembered hold": fq.fit(plant, record, band=(10, 80)),
    "slow ZOH": fq.fit(plant, record, hold="zoh", band=(10, 80)),
}

# a velocity controller from each model: state feedback and a Kalman filter, at the converter's rate
fig, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 5), layout="constrained")
for row, (name, est) in enumerate(models.items()):
    sampled = control.c2d(est.to_control(), dt)
    K, _, _ = control.dlqr(sampled, 1e2 * sampled.C.T @ sampled.C + 1e-6 * np.eye(3), np.eye(1))
    L, _, _ = control.dlqe(sampled.A, np.eye(3), sampled.C, 1e-3 * np.eye(3), 1e-2 * np.eye(1))
    controller = control.ss(sampled.A - sampled.B @ K - L @ sampled.C, L, K, 0, dt)
    # and on the true axis
    true = control.c2d(plant.to_control(), dt)
    closed = control.feedback(true, controller, -1)
    growth = np.abs(closed.poles()).max()
    print(
        f"{name}: largest closed-loop pole {growth:.5f}, {'stable' if growth < 1 else 'UNSTABLE'}"
    )
    t = dt * np.arange(600)
    u = np.where(t < 0.01, 1.0, 0.0)
    answer = fq.simulate(closed, u, dt)
    axes[row].plot(t, fq.simulate(true, u, dt).y, "--", color="#7f7f7f", label="without control")
    axes[row].plot(t, answer.y, color="#0072B2", label=f"controller from {name}")
    axes[row].set(ylabel="velocity / (rad/s)", ylim=(-30, 30))
    axes[row].legend(loc="upper right")
axes[1].set_xlabel("time / s")
fig.savefig(out / "closed_loop.png", dpi=150)

# the way back: control systems draw and simulate like models
ax = fq.bode(models["remembered hold"], plant.to_control(), labels=["estimate", "true"], unit="Hz")
ax[0].figure.savefig(out / "estimate_and_control.png", dpi=150)
plt.close("all")
