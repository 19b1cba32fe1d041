# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A measured robot, step by step
#
# A steel ruler on a DC motor, ten repeats of one sweep in closed loop, everything in counts.
# The model and the ways to read and to fit are those of `examples/ruler_robot.py`;
# `FREQID_DATA` says where the records are. What each finding means stands in [the worked
# example](../ruler_robot.md).

# %%
# %matplotlib inline
import sys
from pathlib import Path

import numpy as np

import freqid as fq

here = Path.cwd()
examples = next(p / "examples" for p in (here, *here.parents) if (p / "examples").is_dir())
sys.path.insert(0, str(examples))
import ruler_robot as study

records = study.read_all(study.data_folder())
records[0]

# %%
fq.check_record(records[0])[["channel", "finding", "value"]]

# %%
records = [r.detrend() for r in records]
axes = fq.plot_record(records[0])
# %% [markdown]
# ## The response, through the reference
#
# In closed loop the noise comes back through the input. Through the reference it does not:

# %%
frf = fq.h1(records, window="boxcar", detrend=False, band=study.BAND, reference=True)
axes = fq.plot_coherence(frf)
# %% [markdown]
# ## Parameters, from five of the ten

# %%
study.robot()

# %%
grey = study.estimate(records[:5])
grey

# %%
grey.modes().round(4)

# %%
grey.verdict

# %% [markdown]
# ## On a repeat that was not used

# %%
comparison = fq.compare(grey, records[7], band=study.BAND)
comparison

# %%
axes = comparison.plot()
# %%
fq.residual_test(grey, records[7], band=study.BAND).round(3)

# %% [markdown]
# ## Beside the measured response

# %%
omega = 2 * np.pi * np.linspace(*study.BAND, 400)
model = grey.frequency_response(omega, fq.ZeroOrderHold(2e-3))
for channel, name in enumerate(study.robot().outputs):
    pair = (study.only(frf, channel), study.only(model, channel))
    fq.bode(*pair, labels=["measured", "grey box"], unit="Hz")[0].set_title(f"motor to {name}")

# %% [markdown]
# ## Decimated by ten
#
# The paper's question on measured data. Deviations from the full-rate estimate, in its standard
# errors:

# %%
full = study.estimate(records)
study.decimated(records, full, (10,)).round(1)
