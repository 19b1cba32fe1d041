"""Every number of docs/scale.md, printed as a table.

    python benchmarks/scale.py            sizes up to 1e7 samples, about five minutes
    python benchmarks/scale.py --large    1e8 samples, on disk and in memory, and 10,000 records of
                                          20,000 (12 GiB of memory free)
    python benchmarks/scale.py --huge     1e9 samples on disk (8 GB) instead

Each ratio compares two things timed in turn in this one run, at one BLAS thread.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd
import scipy.fft
import scipy.optimize
import scipy.signal

import freqid as fq
from freqid.frf import spectra

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from table import show

T1, BAND = 0.5e-3, (10, 50)  # Hz: 4 % of the Nyquist limit
PLANT = fq.two_mass()
START = {"k": 1.8e5, "Jm": 7.5e-4, "Ja": 13.0}
ROUNDS = 5


def best(*functions, rounds=ROUNDS):
    """The least time of each of several functions, called in turn."""
    times = [[] for _ in functions]
    for _ in range(rounds):
        for function, own in zip(functions, times, strict=True):
            begin = time.perf_counter()
            function()
            own.append(time.perf_counter() - begin)
    return [min(own) for own in times]


def chirp(count):
    u = fq.chirp(*BAND, count * T1, T1)
    record = fq.simulate(PLANT, u, T1)
    return record.with_noise(0.01 * float(record.y.std()))


def fresh(record):
    """The same record, which has not been asked for its lines."""
    return fq.Record(record.u, record.y, record.dt)


def fft_stage(count):
    record = chirp(count)
    copies = iter([fresh(record) for _ in range(ROUNDS)])
    ours, bare = best(
        lambda: spectra(next(copies), BAND),
        lambda: (scipy.fft.rfft(record.u), scipy.fft.rfft(record.y)),
    )
    show(f"lines of {count:.0e} samples, 4 % of Nyquist / two bare rffts",
         f"{ours:.2f} s / {bare:.2f} s = {ours / bare:.2f}", "at most 0.6")  # fmt: skip


def segments(u, y, length):
    """H1, H2 and coherence by hand: batches of Hann-windowed segments that overlap by half."""
    window = scipy.signal.get_window("hann", length)
    step, total = length // 2, None
    views = [np.lib.stride_tricks.sliding_window_view(x, length)[::step] for x in (u, y)]
    for at in range(0, len(views[0]), 16):
        U, Y = (
            scipy.fft.rfft((v[at : at + 16] - v[at : at + 16].mean(axis=1, keepdims=True)) * window)
            for v in views
        )
        part = np.array([(np.abs(U) ** 2).sum(0), (np.conj(U) * Y).sum(0), (np.abs(Y) ** 2).sum(0)])
        total = part if total is None else total + part
    uu, uy, yy = total
    return uy / uu, yy / np.conj(uy), np.abs(uy) ** 2 / (uu.real * yy.real)


def averages(count):
    record = chirp(count)
    ours, bare = best(lambda: fq.h1(record, 20_000), lambda: segments(record.u, record.y, 20_000))
    show(f"h1 with coherence of {count:.0e} samples / batched segments by hand",
         f"{ours:.2f} s / {bare:.2f} s = {ours / bare:.2f}", "at most 1.2")  # fmt: skip


def fits(counts):
    times = []
    for count in counts:
        record = chirp(count)
        spectra(record, BAND)
        times.append(best(lambda: fq.fit(PLANT, record, band=BAND, start=START))[0])  # noqa: B023
    told = ", ".join(f"{n:.0e}: {1e3 * t:.0f} ms" for n, t in zip(counts, times, strict=True))
    show("fit after the FFT stage, by samples", told, "within 20 % of one time")


def asked(counts):
    """What a verdict takes beside its fit: of a chirp's band, and of white noise at all lines."""
    for what, band in (("a band of 4 %", BAND), ("all lines", None)):
        told = []
        for count in counts:
            record = chirp(count)
            if band is None:
                record = fq.simulate(PLANT, fq.white_noise(count, seed=1), T1)
                record = record.with_noise(0.01 * float(record.y.std()), seed=2)
            begin = time.perf_counter()
            est = fq.fit(PLANT, record, band=band, start=START)
            fitted, begin = time.perf_counter() - begin, time.perf_counter()
            grade = est.verdict.grade
            taken = time.perf_counter() - begin
            told.append(f"{count:.0e}: {taken:.2f} s beside {fitted:.2f} ({grade})")
        show(f"the verdict of a fit beside it, {what}, by samples", ", ".join(told), "")


def everything(count):
    record = chirp(count)
    copies = iter([fresh(record) for _ in range(ROUNDS)])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ours, bare = best(
        lambda: fq.fit(PLANT, next(copies), band=BAND, start=START),
        lambda: (scipy.fft.rfft(record.u), scipy.fft.rfft(record.y)),
    )
    more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 2**20
    told = f"{ours:.2f} s / {bare:.2f} s = {ours / bare:.2f}, {more:.1f} GiB more"
    show(f"fit to {count:.0e} samples, all of it / two bare rffts", told, "at most 2, 1 GiB")


def streamed(count, rounds=ROUNDS):
    """A file of float32, read block by block; both need not fit into memory."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npy"
        rows = np.lib.format.open_memmap(path, "w+", np.float32, (count, 2))
        size = 1 << 20
        for at in range(0, count, size):
            u = np.random.default_rng(at).standard_normal(min(size, count - at))
            rows[at : at + size] = np.column_stack([u, np.roll(u, 1)])
        del rows

        def by_hand():
            blocks = np.load(path, mmap_mode="r")
            for at in range(0, count - 20_000, 10_000):
                scipy.fft.rfft(np.asarray(blocks[at : at + 20_000], float), axis=0)

        ours, bare = best(lambda: fq.h1(fq.open(path, dt=T1), 20_000), by_hand, rounds=rounds)
        show(f"h1 of {count:.0e} samples on disk / reading and bare FFTs of the segments",
             f"{ours:.1f} s / {bare:.1f} s = {ours / bare:.2f}", "at most 1.5")  # fmt: skip
        show("its most memory, the interpreter and all libraries included",
             f"{peak_of(PASS.format(what='fq.h1(stream, 20_000)'), path):.0f} MiB",
             "400 MiB")  # fmt: skip
        whole = f"fq.fit(fq.first_order(), stream, band={BAND})"
        fit = best(
            lambda: fq.fit(fq.first_order(), fq.open(path, dt=T1), band=BAND), rounds=rounds
        )[0]
        show(f"fit to {count:.0e} samples on disk, one pass",
             f"{fit:.1f} s, {peak_of(PASS.format(what=whole), path):.0f} MiB in all")  # fmt: skip


PASS = """
import sys
from pathlib import Path
import freqid as fq
stream = fq.open(sys.argv[1], dt=0.5e-3)
{what}
# that of getrusage begins with the parent's
told = Path("/proc/self/status").read_text().split()
print(told[told.index("VmHWM:") + 1])
"""


def peak_of(script, path):
    """The most memory, in MiB, of a process of its own."""
    call = [sys.executable, "-c", script, str(path)]
    return int(subprocess.run(call, capture_output=True, check=True).stdout) / 2**10


def by_leastsq(record):
    """A first-order lag by leastsq on lfilter: the strongest thing a user writes in its place."""
    u, y, dt = record.u, record.y, record.dt

    def error(x):
        pole = np.exp(-x[1] * dt)
        return scipy.signal.lfilter([0, x[0] / x[1] * (1 - pole)], [1, -pole], u) - y

    return scipy.optimize.leastsq(error, [120.0, 80.0])[0]


def lags(count, samples):
    """Records of a first-order lag, each with noise of its own."""
    one = fq.simulate(fq.first_order(), fq.chirp(2, 60, samples * 1e-3, 1e-3), 1e-3)
    size = 0.01 * float(one.y.std())
    return [one.with_noise(size, seed=seed) for seed in range(count)]


def fleet(count, samples, wanted, jobs=2):
    records, compared = lags(count, samples), min(count, 500)
    asked = {"start": {"b": 120.0, "a": 80.0}, "verdicts": False, "progress": False}

    def table_of(n_jobs):
        # a record keeps its spectra, which would be there the second time
        given = [fresh(r) for r in records]
        begin = time.perf_counter()
        table = fq.fit_many(fq.first_order(), given, n_jobs=n_jobs, **asked)
        return table, time.perf_counter() - begin

    table_of(1) if count <= 2000 else None
    table, ours = table_of(1)
    begin = time.perf_counter()
    theirs = np.array([by_leastsq(r) for r in records[:compared]])
    bare = (time.perf_counter() - begin) / compared
    assert np.allclose(table[["b", "a"]][:compared], theirs, rtol=1e-2)
    told = f"{1e3 * ours / count:.2f} ms / {1e3 * bare:.2f} ms"
    show(f"{count} records of {samples} samples, a row / leastsq on lfilter", told, wanted)
    other, took = table_of(jobs)
    assert np.allclose(table[["b", "a"]], other[["b", "a"]], rtol=1e-6)
    show(f"the same on {jobs} processes, which have to start", f"{ours / took:.2f} times faster",
         "1.8 times")  # fmt: skip
    took = table_of(jobs)[1]
    show("the same once they run", f"{ours / took:.2f} times faster", "1.8 times")


def at_once(what, timed, count=200, samples=20_000):
    """How much two processes that share nothing but the machine do at once."""
    from joblib.externals.loky import ProcessPoolExecutor

    with ProcessPoolExecutor(max_workers=2) as pool:
        list(pool.map(timed, [4, 4], [samples] * 2))
        alone = min(pool.submit(timed, count, samples).result() for _ in range(2))
        both = min(max(pool.map(timed, [count] * 2, [samples] * 2)) for _ in range(2))
    show(f"{what} in two processes that share nothing but the machine",
         f"{2 * alone / both:.2f} times as much")  # fmt: skip


def with_leastsq(count, samples):
    records = lags(count, samples)
    begin = time.perf_counter()
    for record in records:
        by_leastsq(record)
    return time.perf_counter() - begin


def in_a_batch(count, samples):
    records = lags(count, samples)
    asked = {"start": {"b": 120.0, "a": 80.0}, "verdicts": False, "progress": False}
    begin = time.perf_counter()
    fq.fit_many(fq.first_order(), records, n_jobs=1, **asked)
    return time.perf_counter() - begin


def verdicts(count=64, samples=20_000):
    """Rows with verdicts on one process and on two that have started."""
    records, took = lags(count, samples), {}
    for n_jobs in (2, 1, 2):
        given = [fresh(r) for r in records]
        begin = time.perf_counter()
        fq.fit_many(fq.first_order(), given, n_jobs=n_jobs, progress=False)
        took[n_jobs] = time.perf_counter() - begin
    told = f"{1e3 * took[1] / count:.0f} ms, {took[1] / took[2]:.2f} times as fast on two"
    show(f"{count} records of {samples} samples, a row with its verdict", told, "1.8 times")


def cluster(counts=(100, 200), samples=20_000):
    """Rows with their verdicts on a local cluster: what the plan of docs/scale.md counts on."""
    import joblib
    from distributed import Client, LocalCluster

    for workers in (1, 2):
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=":0"
            ) as machines,
            Client(machines),
            joblib.parallel_config(backend="dask"),
        ):
            fq.fit_many(fq.first_order(), lags(4 * workers, samples), chunk=1, progress=False)
            for count in counts:
                records = lags(count, samples)
                begin = time.perf_counter()
                fq.fit_many(fq.first_order(), records, progress=False)
                took = time.perf_counter() - begin
                show(f"{count} records of {samples} samples, verdicts, on a cluster of {workers}",
                     f"{1e3 * took / count:.0f} ms a row")  # fmt: skip


def files(folder, count, samples):
    """Files of as many records, as a logger writes them."""
    paths = [Path(folder) / f"{i}.parquet" for i in range(count)]
    for path, record in zip(paths, lags(count, samples), strict=True):
        rows = {"time": record.time, "u": record.u, "y": record.y}
        pd.DataFrame(rows).astype({"u": "f4", "y": "f4"}).to_parquet(path)
    return paths


def reading(count=500, samples=20_000):
    """What a record takes before it is fitted, and a fleet of files on one process and on two."""
    with tempfile.TemporaryDirectory() as folder:
        paths = files(folder, count, samples)
        size = sum(path.stat().st_size for path in paths) / count
        took = best(lambda: [fq.read(path) for path in paths], rounds=2)[0]
        show(f"reading a Parquet file of {samples} samples, {size / 1e3:.0f} kB",
             f"{1e3 * took / count:.1f} ms")  # fmt: skip
        asked = {"start": {"b": 120.0, "a": 80.0}, "verdicts": False, "progress": False}

        def table(n_jobs):
            return fq.fit_many(fq.first_order(), paths, n_jobs=n_jobs, **asked)

        table(2)
        one, two = best(lambda: table(1), lambda: table(2), rounds=2)
        told = f"{1e3 * one / count:.1f} ms, {one / two:.2f} times as fast on two"
        show(
            f"{count} files of {samples} samples, a row of each, read and fitted", told, "1.8 times"
        )


def sweep(count, samples=20_000):
    """A robot of three axes at many postures, eighteen parameters, logged at 2 ms."""
    import robot

    rng = np.random.default_rng(0)
    records, dt = [], 2e-3
    for _ in range(count):
        q2, q3 = rng.uniform(-1.5, 1.5, 2)
        plant = robot.robot().with_conditions(q2=q2, q3=q3)
        one = fq.simulate(plant, rng.standard_normal((samples, 3)), dt)
        records.append(one.with_noise(0.01 * one.y.std(axis=0)))
    start = {n: v * (1 + 0.2 * rng.uniform(-1, 1)) for n, v in robot.TRUE.items()}
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.perf_counter()
    est = fq.fit(robot.robot(), records, band=(1, 60), start=start, n_starts=1)
    took = time.perf_counter() - begin
    more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 2**20
    off = max(abs(est[n] / v - 1) for n, v in robot.TRUE.items())
    told = f"{took:.1f} s, {more:.1f} GiB more, off by {100 * off:.2g} % at most"
    show(f"{count} postures of three axes, {samples} samples, 18 parameters", told, "30 s, 2 GiB")


def resampled():
    plant = fq.first_order()
    runs = [
        fq.simulate(plant, fq.chirp(2, 60, 11, 1e-3), 1e-3).with_noise(0.05, seed=s)
        for s in range(4)
    ]
    begin = time.perf_counter()
    fq.bootstrap(plant, runs, n=200)
    show("bootstrap of 200 over four repeats of 11,000 samples",
         f"{time.perf_counter() - begin:.1f} s", "below 5 s")  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--huge", action="store_true")
    given = parser.parse_args()
    if given.huge:
        streamed(1_000_000_000, rounds=1)
        return
    large = given.large
    resampled()
    sweep(200 if large else 50)
    fleet(1000, 2000, "1 ms")
    fleet(10_000 if large else 1000, 20_000, "3 ms")
    at_once("leastsq", with_leastsq)
    at_once("the batch", in_a_batch)
    verdicts()
    reading()
    cluster()
    fits([20_000, 200_000, 2_000_000])
    asked([20_000, 200_000, 2_000_000])
    fft_stage(10_000_000)
    averages(10_000_000)
    streamed(100_000_000 if large else 10_000_000)
    everything(100_000_000 if large else 10_000_000)


if __name__ == "__main__":
    main()
