# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From a chirp experiment to parameters
#
# A robot axis, motor and arm with a spring between them, is driven by a chirp; on the way to
# the file every tenth sample is kept. What comes out of an identification, and may it be
# believed?

# %%
# %matplotlib inline
import tempfile
from pathlib import Path

import freqid as fq

plant = fq.two_mass()
plant

# %% [markdown]
# The experiment: a chirp from 10 to 80 Hz, which the converter holds for 0.5 ms, and some noise
# on the velocity. The log keeps one sample in ten and remembers what the converter did.

# %%
u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
names = {"input_names": ["torque"], "output_names": ["velocity"]}
record = fq.simulate(plant, u, dt=0.5e-3, **names)
slow = record.with_noise(0.1, seed=1).decimate(10)
slow

# %%
axes = slow.plot()
# %% [markdown]
# ## As other tools take it
#
# They see samples 5 ms apart and assume that the input was constant between them.

# %%
wrong = fq.fit(plant, slow, hold="zoh", band=(10, 80))
wrong

# %% [markdown]
# The damping is negative where 10 is true, with a small error bar. The estimate carries a
# verdict, and that says what is the matter:

# %%
wrong.verdict

# %% [markdown]
# ## With the hold that the record remembers

# %%
est = fq.fit(plant, slow, band=(10, 80))
est

# %%
est.verdict

# %% [markdown]
# The witness is a black box of the plant's order that was fitted to the same data. It explains
# no more than the grey box does, so that no better minimum is left to be found:

# %%
est.witness

# %% [markdown]
# ## What the data show
#
# Everything in one figure is drawn through one hold, that of the record. The estimate with the
# remembered hold lies on what was measured. The other has the resonance right and hardly anything
# else: its notch stands too far left and is too shallow, and its phase rises where the axis' falls.

# %%
frf = fq.etfe(slow, band=(10, 80))
labels = ["measured", "remembered hold", "slow ZOH"]
axes = fq.bode(frf, est, wrong, labels=labels, unit="Hz")

# %% [markdown]
# ## On an experiment that was not used

# %%
sines = fq.multisine((10, 80), period=2.0, dt=0.5e-3, periods=3, seed=2)
other = fq.simulate(plant, sines, dt=0.5e-3)
comparison = fq.compare(est, other.with_noise(0.1, seed=3).decimate(10))
comparison

# %%
axes = comparison.plot()
# %% [markdown]
# ## To keep
#
# `est.save` writes the values, their covariance, the hold, the witness and the verdict;
# `fq.load` opens it in another process, where it simulates, draws and goes into a controller's
# design.

# %%
path = Path(tempfile.mkdtemp()) / "axis.json"
est.save(path)
print(fq.load(path).to_control())
