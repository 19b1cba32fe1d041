"""The same numbers and the same verdict, whatever instructions a processor has for linear algebra.

BLAS takes other kernels on each processor, and numpy other loops, which add in another order: the
last digits differ, and nothing that is said may. Here older processors are asked for by name.
"""

import json
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

OLDER = {
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512F AVX2 FMA3",
}
FITS = """
import json, sys
import numpy as np
import freqid as fq

two = fq.two_mass()
chirp = fq.simulate(two, fq.chirp(10, 80, 2, 0.5e-3), 0.5e-3).with_noise(0.05, seed=1)
steps = np.where(np.random.default_rng(3).random(300) < 0.5, -1.0, 1.0)
integrator = fq.simulate(fq.first_order(b=1.0, a=1e-12), steps, 0.01)
noisy = fq.simulate(fq.first_order(b=50.0, a=20.0), fq.white_noise(800, seed=2), 0.01)
noisy = noisy.with_noise(0.1 * noisy.y.std(), seed=4)
asked = {
    "axis": (two.with_values(**{n: 1.2 * two[n] for n in ("Jm", "k")}), chirp, {}),
    "slow axis": (two, chirp.decimate(10), {}),
    "wrong hold": (two, chirp.decimate(10), {"hold": "zoh"}),
    "weighted": (fq.first_order(), noisy, {"weights": "noise"}),
    "integrator": (fq.OutputError(1), fq.Record(steps, integrator.y, 0.01, hold="zoh"), {}),
    "rational": (fq.TransferFunction(1, 2), chirp, {}),
    "box": (fq.OutputError(2), noisy, {}),
}
said = {}
for name, (model, record, given) in asked.items():
    est = fq.fit(model, record, **given)
    std = np.asarray(est.parameters["std"])
    kinds = [w.kind for w in est.warnings]
    said[name] = [est.values.tolist(), std.tolist(), est.verdict.grade, kinds]
json.dump(said, sys.stdout)
"""


def said(**environment):
    told = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", FITS],
        capture_output=True, text=True, check=True, env=os.environ | environment,
    )  # fmt: skip
    return json.loads(told.stdout)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="kernels of x86 by name")
def test_an_older_processor_says_the_same():
    ours, theirs = said(), said(**OLDER)
    for name, (values, std, grade, kinds) in ours.items():
        other, _, other_grade, other_kinds = theirs[name]
        assert (other_grade, other_kinds) == (grade, kinds), name
        # far below what noise leaves open, and where there is none below what anyone reads
        apart = np.abs(np.subtract(values, other))
        assert (apart <= 1e-4 * np.array(std) + 1e-8 * np.abs(values)).all(), (name, apart)
