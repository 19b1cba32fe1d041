# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # The bias, before there are data
#
# What a wrong assumption about the hold costs does not depend on luck. It follows from the
# plant, the spectrum of the input and the two sample times, so it can be computed before
# anybody drives to the robot.

# %%
# %matplotlib inline
import numpy as np

import freqid as fq

plant, converter = fq.two_mass(), fq.ZeroOrderHold(0.5e-3)

# %% [markdown]
# Chirps from 10 Hz up to 30 … 90 Hz, logged at every second to every tenth sample, under three
# assumptions: a ZOH at the slow rate, a FOH at the slow rate, and what the converter did.

# %%
chirps = {f"10-{upper}": fq.ChirpSpectrum(10, upper) for upper in range(30, 91, 10)}
table = fq.bias_map(plant, chirps, [2, 3, 4, 5, 8, 10], ["zoh", "foh", None], base_dt=0.5e-3)
shown = table.query("spectrum == '10-80' and parameter == 'd'")
shown[["factor", "hold", "true", "estimate", "relative_bias"]].round(3)

# %% [markdown]
# The damping `d` over all of them. What is marked is the paper's experiment:

# %%
axes = fq.plot_bias_map(table, "d", mark=["10-80"])
# %% [markdown]
# All parameters at a tenth of the rate, over the width of the chirp:

# %%
axes = fq.plot_bias_curves(table, factor=10)
# %% [markdown]
# ## Why
#
# The estimate lies on what the data *seem* to show where the input has energy, and nowhere
# else. The phase lead at the slow rate cannot be had from a damper that takes energy out, so
# one is found that puts it in.

# %%
axes = fq.plot_bias(plant, chirps["10-80"], 5e-3, "zoh", converter)
# %% [markdown]
# ## Energy above the slow Nyquist limit
#
# It folds back whatever the hold is. A filter before decimation, or an input that is kept at
# its full rate, is the cure.

# %%
noise = fq.WhiteSpectrum()
for name, antialias in (("bare", False), ("behind the anti-alias filter", True)):
    seen = fq.apparent_response(plant, noise, 5e-3, converter, antialias=antialias)
    below = seen.frequency < 70
    print(f"{name}: least coherence below 70 Hz {seen.coherence[..., below].min():.3f}")

# %% [markdown]
# ## Which experiment, then?
#
# Ten seconds, amplitude 1, noise of 0.05 rad/s, logged at 0.5 or 5 ms: the inputs in the order
# of the worst parameter's error, bias and spread together.

# %%
designs = fq.experiment_design(
    plant, 0.5e-3, noise_std=0.05, factors=[1, 10], holds=[None, "foh"], d_optimal=True
)
designs[["excitation", "dt", "hold", "error", "worst"]].head(8)

# %%
axes = np.ravel(fq.plot_design(designs))
