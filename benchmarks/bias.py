"""Maps of bias: speed beside single fits, equality, and memory, printed as a table.

python benchmarks/bias.py            1,000 fits beside 100 single ones, under a minute
python benchmarks/bias.py --large    and 100,000 fits, about six minutes
"""

import argparse
import resource
import time

import numpy as np
from table import show

import freqid as fq
from freqid.bias.apparent import Sampling
from freqid.bias.conditions import Conditions

T1 = 0.5e-3
PLANT = fq.two_mass()
TRUE = fq.ZeroOrderHold(T1)


def chirps(count):
    return {
        f"{low:g}-{high:g}": fq.ChirpSpectrum(low, high)
        for low in (4, 10)
        for high in np.linspace(30, 95, count)
    }


def speed():
    spectra = chirps(100)
    fq.bias_map(PLANT, chirps(2), [2], ["zoh"], T1)
    start = time.perf_counter()
    table = fq.bias_map(PLANT, spectra, [2, 3, 4, 5, 10], ["zoh"], T1)
    each = (time.perf_counter() - start) / 1000
    rows = table[table["parameter"] == "d"]
    picked = rows.sample(100, random_state=1)
    alone, equal, plain = [], [], []
    for row in picked.itertuples():
        dt = row.factor * T1
        conditions = Conditions(spectra[row.spectrum], Sampling(TRUE, T1, row.factor))
        expected = conditions.expected(PLANT.state_space())
        frf = expected.as_response(conditions.sampling, PLANT)
        begin = time.perf_counter()
        fq.fit(PLANT, frf, hold=fq.ZeroOrderHold(dt), weights=expected.weight)
        plain.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        est = fq.asymptotic_fit(PLANT, spectra[row.spectrum], dt, "zoh", TRUE)
        alone.append(time.perf_counter() - begin)
        part = table.query("spectrum == @row.spectrum and factor == @row.factor")
        equal.append(np.allclose(part["estimate"], est.values, rtol=1e-6))
    show("map of 1,000 fits: time of one, of a single fq.fit", f"{each / np.mean(plain):.3f} "
         f"({1e3 * each:.1f} of {1e3 * np.mean(plain):.0f} ms)", "<= 0.1")  # fmt: skip
    show("time of one, of a single asymptotic_fit", f"{each / np.mean(alone):.3f}", "")
    show("rows converged", f"{100 * table['converged'].mean():.1f} %", ">= 99 %")
    show("equal to single fits to 1e-6, of 100", f"{100 * np.mean(equal):.0f} %", ">= 99 %")
    remembered = fq.bias_map(PLANT, spectra, [2, 5, 10], [None], T1)
    show("remembered hold: largest relative bias", f"{remembered['relative_bias'].abs().max():.0e}",
         "< 1e-6")  # fmt: skip


def memory():
    spectra = chirps(5000)
    table = fq.bias_map(PLANT, spectra, [2, 3, 4, 5, 10], ["zoh", "foh"], T1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    show(f"map of {len(table) // 5} fits: most memory, all of the process",
         f"{peak:.2f} GiB", "< 1 GiB")  # fmt: skip
    show("rows converged", f"{100 * table['converged'].mean():.2f} %", ">= 99 %")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--large", action="store_true")
    large = parser.parse_args().large
    speed()
    if large:
        memory()
