"""A flexible robot identified from ten measured sweeps: from files to trusted parameters.

python examples/ruler_robot.py [folder for the pictures] [decimation factors, 5 and 10]

The records (swept_01.csv to swept_10.csv) are looked for in the folder that FREQID_DATA names, or
in ../shared/data beside the checkout.
"""

import os
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import freqid as fq

BAND = (1, 18)  # Hz: the sweep fades above
NAMES = {"inputs": "motor", "outputs": ["angle", "acceleration"], "reference": "reference"}


def data_folder():
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("FREQID_DATA", beside)) / "ruler_robot"


def ruler(g, b, te, f1, z1, a1, f2, z2, a2, c0, c1, c2):
    """A motor turns a ruler: angle θ, and two bending modes q of the ruler clamped at the motor.

    θ'' + bθ' + Σ aᵢ qᵢ'' = g i, te i' = v − i, qᵢ'' + 2 zᵢ wᵢ qᵢ' + wᵢ² qᵢ = −aᵢ θ''; the sensor at
    the tip shows c₀ θ'' + Σ cᵢ qᵢ''. States: θ, q, their velocities, and the current i.
    """
    w1, w2, shape = 2 * np.pi * f1, 2 * np.pi * f2, np.shape(g)
    kind = np.result_type(g, b, te, f1, z1, a1, f2, z2, a2, c0, c1, c2)
    M, K, D = (np.zeros((*shape, 3, 3), kind) for _ in range(3))
    M[..., range(3), range(3)] = 1
    M[..., 0, 1] = M[..., 1, 0] = a1
    M[..., 0, 2] = M[..., 2, 0] = a2
    K[..., 1, 1], K[..., 2, 2] = w1**2, w2**2
    D[..., 0, 0], D[..., 1, 1], D[..., 2, 2] = b, 2 * z1 * w1, 2 * z2 * w2
    inverse = np.linalg.inv(M)
    A = np.zeros((*shape, 7, 7), kind)
    A[..., :3, 3:6] = np.eye(3)
    A[..., 3:6, :3], A[..., 3:6, 3:6] = -inverse @ K, -inverse @ D
    A[..., 3:6, 6] = inverse[..., 0] * np.asarray(g)[..., None]
    A[..., 6, 6] = -1 / te
    B = np.zeros((*shape, 7, 1), kind)
    B[..., 6, 0] = 1 / te
    C = np.zeros((*shape, 2, 7), kind)
    C[..., 0, 0] = 1
    tip = np.stack([c0, c1, c2], axis=-1)
    C[..., 1, :] = (tip[..., None, :] @ A[..., 3:6, :])[..., 0, :]
    return A, B, C, np.zeros((*shape, 2, 1))


def robot():
    signed = (-np.inf, np.inf)
    return fq.GreyBox(
        ruler,
        [
            fq.Parameter("g", 150, "1/s²"),
            fq.Parameter("b", 10, "1/s"),
            fq.Parameter("te", 2e-3, "s", lower=1e-5),
            fq.Parameter("f1", 2.5, "Hz"),
            fq.Parameter("z1", 0.01, lower=0),
            fq.Parameter("a1", 0.8, physical=(-1, 1)),
            fq.Parameter("f2", 17, "Hz"),
            fq.Parameter("z2", 0.02, lower=0),
            fq.Parameter("a2", 0.1, physical=(-1, 1)),
            fq.Parameter("c0", -2e-3, "s²", physical=signed),
            fq.Parameter("c1", -3e-3, "s²", physical=signed),
            fq.Parameter("c2", 3e-3, "s²", physical=signed),
        ],
        inputs=["motor"],
        outputs=["angle", "acceleration"],
        name="ruler robot",
        vectorized=True,
    )


def read_all(folder):
    return [fq.read(path, **NAMES) for path in sorted(folder.glob("swept_*.csv"))]


def estimate(records, **options):
    # what the loop does to the noise is a hundredth of the signal: the input as it is does no harm
    return fq.fit(
        robot(), records, band=BAND, weights="noise", n_starts=1, reference=False, **options
    )


def main(out, factors=(5, 10)):
    records = read_all(data_folder())
    print(records[0])
    print(fq.check_record(records[0])[["channel", "finding", "value"]].to_string(index=False))
    records = [r.detrend() for r in records]
    axes = fq.plot_record(records[0])
    axes[0].figure.savefig(out / "ruler_record.png", dpi=120)

    # the plant ran in a loop: through the reference the response is free of what that does to noise
    frf = fq.h1(records, window="boxcar", detrend=False, band=BAND, reference=True)
    fq.plot_coherence(frf).figure.savefig(out / "ruler_coherence.png", dpi=120)

    # a grey and a black box from five repeats, judged on the other five
    grey = estimate(records[:5])
    black = fq.fit(fq.OutputError(6), records[:5], band=BAND, weights="noise", reference=False)
    print(grey)
    print(grey.modes().round(4).to_string(index=False))
    held_out = [fq.compare(grey, r, band=BAND).fit_percent for r in records[5:]]
    print("fit in the band on the repeats that were not used:", np.mean(held_out, axis=0).round(1))
    print(fq.residual_test(grey, records[7], band=BAND).round(3).to_string(index=False))
    fq.compare(grey, records[7], band=BAND).plot()[0].figure.savefig(
        out / "ruler_validation.png", dpi=120
    )
    omega = 2 * np.pi * np.linspace(*BAND, 400)
    drawn = {
        "measured, through the reference": frf,
        "grey box": grey.frequency_response(omega, fq.ZeroOrderHold(2e-3)),
        "black box, order 6": black.model.frequency_response(omega),
    }
    for channel, name in enumerate(robot().outputs):
        axes = fq.bode(*(only(r, channel) for r in drawn.values()), labels=list(drawn), unit="Hz")
        axes[0].set_title(f"motor to {name}")
        axes[0].figure.savefig(out / f"ruler_{name}.png", dpi=120)

    # the paper's question on measured data: what does decimation do?
    full = estimate(records)
    table = decimated(records, full, factors)
    print("deviation from the full-rate parameters, in standard errors:")
    print(table.round(1).to_string())
    draw_deviations(table).figure.savefig(out / "ruler_decimated.png", dpi=120)
    plt.close("all")


def only(frf, channel):
    """One output of a response."""
    variance = None if frf.variance is None else frf.variance[channel : channel + 1]
    return fq.FrequencyResponse(
        frf.frequency, frf.response[channel : channel + 1], dt=frf.dt, variance=variance
    )


def decimated(records, full, factors=(5, 10)):
    """(estimate − full-rate estimate) over the full-rate standard error, a row an assumption."""
    std = full.parameters["std"]
    rows = {}
    for factor in factors:
        slow = [r.decimate(factor, antialias=True) for r in records]
        for name, hold in (("ZOH", "zoh"), ("FOH", "foh"), ("remembered", None)):
            est = estimate(slow, hold=hold, start=full.parameters["value"])
            rows[f"{name}, every {2 * factor} ms"] = (
                est.parameters["value"] - full.parameters["value"]
            ) / std
    return pd.DataFrame(rows).T


def draw_deviations(table):
    ax = plt.subplots(figsize=(7.2, 4.6), layout="constrained")[1]
    for row, (name, values) in enumerate(table.iterrows()):
        colour = ["#D55E00", "#0072B2", "#009E73"][row % 3]
        marker = "os"[row // 3]
        ax.plot(
            np.arange(len(values)) + 0.1 * (row - 2.5), values, marker, color=colour, label=name
        )
    ax.axhspan(-2, 2, color="#009E73", alpha=0.15, linewidth=0)
    ax.set_yscale("symlog", linthresh=5)
    ax.set_xticks(range(len(table.columns)), list(table.columns))
    ax.set(ylabel="deviation / standard errors", title="Parameters from decimated records")
    ax.legend(ncols=2, fontsize=8, loc="upper left", bbox_to_anchor=(0, -0.1), frameon=False)
    return ax


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    folder.mkdir(parents=True, exist_ok=True)
    if not data_folder().is_dir():
        sys.exit(f"no measured data: {data_folder()} is missing; set FREQID_DATA to its parent")
    main(folder, [int(f) for f in sys.argv[2:]] or (5, 10))
