"""From a chirp experiment to parameters, and what decimation does to them.

python examples/quickstart.py [folder for the picture]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import freqid as fq

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)

# a robot axis, excited by a chirp that the converter holds for 0.5 ms
plant = fq.two_mass()
record = fq.simulate(plant, fq.chirp(10, 80, duration=10, dt=0.5e-3), dt=0.5e-3)

# logged at a tenth of the rate
slow = record.decimate(10)
print(slow)

# what other tools assume, the paper's palliative, and the hold that the record remembers
estimates = {
    "ZOH at 5 ms": fq.fit(plant, slow, hold="zoh", band=(10, 80)),
    "FOH at 5 ms": fq.fit(plant, slow, hold="foh", band=(10, 80)),
    "remembered, ZOH at 0.5 ms": fq.fit(plant, slow, band=(10, 80)),
}
for name, est in estimates.items():
    print(f"\n{name}\n{est.parameters[['value', 'std', 'nominal']]}")
    for warning in est.warnings:
        print("warning:", warning)

omega = 2 * np.pi * np.unique(np.concatenate([np.geomspace(5, 90, 500), np.linspace(16, 28, 600)]))
axes = fq.bode(
    plant.frequency_response(omega),
    *(est.model.frequency_response(omega) for est in estimates.values()),
    labels=["true", *estimates],
    unit="Hz",
)
axes[0].legend(loc="lower left")
axes[0].figure.suptitle("Two-mass axis identified from a chirp decimated by 10")
axes[0].figure.savefig(out / "quickstart.png", dpi=150)
plt.close("all")
