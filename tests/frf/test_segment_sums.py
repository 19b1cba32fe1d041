"""Sums over segments in two threads, beside scipy's csd segment by segment."""

import subprocess
import sys

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.frf.segment_sums import SegmentSums
from freqid.frf.segments import Averaging

DT = 1e-3


@pytest.mark.parametrize("detrend", ["constant", "linear", False, lambda x: x - x[..., :1]])
@pytest.mark.parametrize(("length", "count"), [(100, 1), (100, 7), (1000, 640), (30_000, 9)])
def test_sums_beside_csd(length, count, detrend):
    """Fewer segments than threads, and more values than a thread takes at once."""
    n, step = length + (count - 1) * (length // 2), length // 2
    rows = np.random.default_rng(length).standard_normal((n, 3))
    rows += np.linspace(0, 3, n)[:, None]
    averaging = Averaging(length, None, "hann", 0.5, detrend)
    with SegmentSums(averaging, length, step, ["uu", "yu"]) as sums:
        # a second piece of another size in the memory of the first
        for part in (rows, rows[: length + (count // 2) * step]):
            found = sums.of({"u": part[:, :2].T, "y": part[:, 2:].T})
            whole = (len(part) - length) // step + 1
            _, density = averaging.density(length, DT)
            for pair, a, b in (("uu", 0, 1), ("uu", 0, 0), ("yu", 2, 1)):
                _, right = scipy.signal.csd(
                    part[:, b], part[:, a], 1 / DT, nperseg=length, detrend=detrend
                )
                ours = found[pair][:, a - 2 if pair == "yu" else a, b] * density / whole
                assert np.abs(ours - right).max() < 1e-12 * np.abs(right).max()


def test_what_is_beyond_numbers_is_said_once_by_threads_too():
    rows = 1e200 * np.random.default_rng(0).standard_normal((400_000, 2))
    with pytest.raises(ValueError, match="beyond numbers"):
        fq.h1(fq.Record(rows[:, 0], rows[:, 1], DT), 1000)


def test_averages_where_no_thread_can_begin(tmp_path):
    """In what an interpreter does at its end, after all threads."""
    script = tmp_path / "late.py"
    script.write_text(
        "import atexit, numpy as np, freqid as fq\n"
        "u = np.random.default_rng(0).standard_normal(300_000)\n"
        "record = fq.Record(u, np.roll(u, 1), 1e-3)\n"
        "print(len(fq.h1(record.slice(0, 2), 1000).frequency))\n"
        "atexit.register(lambda: print(len(fq.h1(record, 1000).frequency)))\n"
    )
    told = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert told.stdout.split() == ["500", "500"], told.stderr
