"""Know the bias before the experiment: the paper's plant over inputs, rates and holds, no data.

python examples/bias_study.py [folder for the pictures]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import freqid as fq

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)
plant, converter = fq.two_mass(), fq.ZeroOrderHold(0.5e-3)

# every chirp from 10 Hz up, logged at every second to every tenth sample, under three assumptions
chirps = {f"10-{upper}": fq.ChirpSpectrum(10, upper) for upper in range(30, 96, 5)}
table = fq.bias_map(plant, chirps, [2, 3, 4, 5, 8, 10], ["zoh", "foh", None], base_dt=0.5e-3)
shown = table.query("spectrum == '10-80' and parameter == 'd'")
print(shown[["factor", "hold", "true", "estimate", "relative_bias"]].to_string(index=False))
fq.plot_bias_map(table, "d", mark=["10-80"])[0].figure.savefig(out / "bias_map.png", dpi=150)
fq.plot_bias_curves(table, factor=10)[0].figure.savefig(out / "bias_curves.png", dpi=150)

# why: the estimate lies on what the data show where the input has energy, and nowhere else
axes = fq.plot_bias(plant, chirps["10-80"], 5e-3, "zoh", converter)
axes[0].figure.savefig(out / "bias_why.png", dpi=150)

# energy above the slow Nyquist limit folds back, whatever the hold: filter, or keep the input
noise = fq.WhiteSpectrum()
for name, antialias in (("bare", False), ("behind the anti-alias filter", True)):
    seen = fq.apparent_response(plant, noise, 5e-3, converter, antialias=antialias)
    below = seen.frequency < 70
    print(
        f"white noise, {name}: least coherence below 70 Hz {seen.coherence[..., below].min():.3f}"
    )

# which experiment then: 10 s, amplitude 1, noise of 0.05 rad/s, logged at 0.5 or 5 ms
designs = fq.experiment_design(
    plant, 0.5e-3, noise_std=0.05, factors=[1, 10], holds=[None, "foh"], d_optimal=True
)
columns = ["excitation", "dt", "hold", "error", "worst"]
print(designs[columns].head(8).to_string(index=False))
axes = fq.plot_design(designs)
np.ravel(axes)[0].figure.savefig(out / "design.png", dpi=150)
plt.close("all")
