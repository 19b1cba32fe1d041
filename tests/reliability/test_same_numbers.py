"""The same numbers in every run, on one thread and on two, and in processes of every kind."""

import multiprocessing
import os
import subprocess
import sys

import pytest

import freqid as fq

PLANT = fq.two_mass()
SCRIPT = "from tests.reliability.test_same_numbers import numbers; print(numbers())"


def numbers():
    """A fit, its error bars, a black box, a response and a bootstrap, to the last bit."""
    u = fq.chirp(10, 80, 1, 1e-3)
    record = fq.simulate(PLANT, u, 1e-3).with_noise(0.01)
    est = fq.fit(PLANT, record, band=(10, 80))
    black = fq.fit(fq.OutputError(4), record, band=(10, 80))
    averaged = fq.h1(record, segment=400)
    parts = [record.slice(start, start + 0.3) for start in (0, 0.3, 0.6)]
    again = fq.bootstrap(PLANT, parts, 3, 1, band=(10, 80))
    bars = est.parameters["std"]
    return [
        [float(x).hex() for x in (*est.values, *bars, est.cost, black.cost)],
        [complex(x) for x in averaged.response.ravel()[::7]],
        again.to_numpy().tolist(),
    ]


@pytest.fixture(scope="module")
def expected():
    return repr(numbers())


@pytest.mark.parametrize(("threads", "seed"), [("1", "0"), ("2", "1")])
def test_runs_agree_to_the_last_bit(expected, threads, seed):
    environment = {
        **os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads,
        "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path),
    }  # fmt: skip
    call = [sys.executable, "-c", SCRIPT]
    said = subprocess.run(call, env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == expected


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
@pytest.mark.parametrize("kind", ["fork", "spawn"])
def test_processes_of_every_kind_agree(expected, kind):
    if kind not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system does not {kind}")
    with multiprocessing.get_context(kind).Pool(1) as pool:
        found = repr(pool.apply_async(numbers).get(timeout=120))
    assert found == expected
