"""The short version of ``benchmarks/system_calls.py``: some calls of some writers."""

import os
import shutil
import subprocess

import pytest


@pytest.fixture(scope="module")
def stepping(benchmarks):
    """Both modules, where ``strace`` is there and may look at other processes."""
    if not shutil.which("strace"):
        pytest.skip("strace is not installed")
    other = subprocess.Popen(["sleep", "60"])
    try:
        call = ["strace", "-o", os.devnull, "-p", str(other.pid)]
        watching = subprocess.Popen(call, stderr=subprocess.PIPE, text=True)
        allowed = "attached" in watching.stderr.readline()
    finally:
        other.kill()
        other.wait()
        watching.wait()
        watching.stderr.close()
    if not allowed:
        pytest.skip("strace may not look at other processes here")
    import system_calls
    import writers

    return system_calls, writers


@pytest.mark.parametrize(
    ("name", "every"), [("record.npz", 3), ("estimate.json", 3), ("fleet.parquet", 19)]
)
def test_what_is_stopped_at_a_system_call_is_as_before_or_whole(stepping, name, every):
    """An error of the disk once came without a file's name, and left a hidden file behind."""
    steps, writers = stepping
    count, wrong = steps.stopped(writers.WRITERS[name], every)
    assert count > 6
    assert not wrong, "\n".join(wrong)


def test_a_writer_that_is_not_whole_would_be_seen(stepping):
    steps, writers = stepping

    def in_place(path, content):
        with open(path, "wb") as file:
            for part in range(3):
                file.write(bytes([content]) * 5000 + bytes([part]))
                file.flush()

    plain = writers.Written("plain.bin", in_place, writers.text_of)
    wrong = steps.stopped(plain)[1]
    assert any("SIGKILL" in w and "neither the old nor the new" in w for w in wrong)
    assert any("no file is named" in w for w in wrong)
