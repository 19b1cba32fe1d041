"""Writing, stopped at each system call in turn: killed there, or told that the call has failed.

    python benchmarks/system_calls.py                  every call of every writer
    python benchmarks/system_calls.py --every 5 record.npz

With ``strace``, which injects a signal or an error into the n-th call of a kind. Only calls that
change a file or a folder are stopped: between two of them the disk stays as it is. After each the
file has to be as it was or as it should be, jobs that can be resumed have to come to the
undisturbed result, an error has to be an OSError or a ValueError that names the file, and only a
kill may leave a hidden file behind.
"""

import argparse
import collections
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

# calls that change what a disk holds, and the error that each of them has when it fails
CALLS = {
    "openat": "ENOSPC", "mkdir": "ENOSPC", "write": "ENOSPC", "writev": "ENOSPC",
    "pwrite64": "ENOSPC", "ftruncate": "ENOSPC", "fallocate": "ENOSPC", "rename": "EIO",
    "renameat": "EIO", "fsync": "EIO", "fdatasync": "EIO", "close": "EIO", "unlink": "EACCES",
    "unlinkat": "EACCES", "rmdir": "EACCES", "link": "EPERM", "flock": "ENOLCK",
}  # fmt: skip
_LINE = re.compile(r"^(\d+)\s+(?:<\.\.\. )?(\w+)\((.*)$")
# seconds that a call which has failed may make a writer take
_LONG = 60


def _asked(function, *args, before=None):
    """What a function returns, or the exception it raises, in a process of its own.

    ``before`` is given the process's number and waited for first. None stands for a killed one.
    """
    answer, said = os.pipe()
    wait, go = os.pipe()
    with warnings.catch_warnings():
        # nothing else runs in this process while it is doubled
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            os.close(answer)
            os.close(go)
            # calls are counted, and fail, from here on
            os.write(said, b".")
            os.read(wait, 1)
            try:
                result = function(*args)
            except BaseException as error:
                result = (type(error).__mro__[:-1], str(error))
            # kept open until the end, so that its number is none that is watched
            os.write(said, pickle.dumps(result))
        finally:
            # whatever happens, the double of this process goes no further
            os._exit(0)
    os.close(said)
    os.close(wait)
    os.read(answer, 1)
    watching = before(child) if before else None
    os.write(go, b".")
    os.close(go)
    with os.fdopen(answer, "rb") as file:
        told = file.read()
    os.waitpid(child, 0)
    if watching:
        watching.communicate(timeout=_LONG)
    return pickle.loads(told) if told else None


def _watched(*options):
    """What strace is started as, on a process that waits."""

    def begin(child):
        call = ["strace", "-f", "-p", str(child), *options]
        watching = subprocess.Popen(call, stderr=subprocess.PIPE, text=True)
        told = watching.stderr.readline()
        if "attached" not in told:
            raise SystemExit(told + watching.communicate()[1])
        return watching

    return begin


def _places(writer, folder):
    """Which calls of which kind are about files of a folder: [(kind, number)]."""
    log = folder.with_suffix(".log")
    kinds = ",".join(CALLS)
    _asked(writer.act, folder, before=_watched("-y", "-o", str(log), "-e", f"trace={kinds}"))
    count, found = collections.Counter(), []
    for line in log.read_text(errors="replace").splitlines():
        told = _LINE.match(line)
        if told and "resumed>" not in line:
            process, kind, rest = told.groups()
            count[process, kind] += 1
            changes = kind != "openat" or "O_CREAT" in rest or "O_WRONLY" in rest
            if str(folder) in rest and changes:
                found.append((kind, count[process, kind]))
    log.unlink()
    return list(dict.fromkeys(found))


def stopped(writer, every=1):
    """What is wrong with a writer: calls it was stopped at, and a text for each that went wrong."""
    with tempfile.TemporaryDirectory(prefix="calls-") as own:
        fresh, warm = Path(own) / "fresh", Path(own) / "warm"
        fresh.mkdir()
        _asked(writer.prepare, fresh)
        # what is imported on the way is imported here, once
        writer.act(_copied(fresh, warm))
        writer.check(warm)
        places = _places(writer, _copied(fresh, Path(own) / "first"))
        wrong, count = [], 0
        for number, (kind, n) in enumerate(places[::every]):
            for how in (f"signal=SIGKILL:when={n}", f"error={CALLS[kind]}:when={n}"):
                folder = _copied(fresh, Path(own) / f"{number}")
                inject = _watched("-o", os.devnull, "-e", f"inject={kind}:{how}")
                outcome = _asked(writer.act, folder, before=inject)
                problem = _judged(writer, folder, kind, outcome)
                if problem:
                    wrong.append(f"{writer.name}, {kind} {how}: {problem}")
                count += 1
                shutil.rmtree(folder, ignore_errors=True)
        return count, wrong


def _copied(fresh, folder):
    shutil.copytree(fresh, folder)
    return folder


def _judged(writer, folder, kind, outcome):
    """What is wrong after a stop, or nothing."""
    if isinstance(outcome, tuple):
        kinds, text = outcome
        if not issubclass(kinds[0], OSError | ValueError):
            return f"{kinds[0].__name__}: {text}"
        if str(folder) not in text or "None" in text:
            return f"no file is named: {text}"
    if outcome is not None and not kind.startswith("unlink"):
        # finished rows of a job are kept, in a folder of their own
        left = [p.name for p in folder.rglob(".*") if p.suffix != ".parts"]
        if left:
            return f"left behind: {left}, after {outcome}"
    told = _asked(writer.check, folder)
    return None if told is True else str(told)


def main():
    from table import show
    from writers import WRITERS

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("writers", nargs="*", choices=[*WRITERS, []], default=[])
    parser.add_argument("--every", type=int, default=1, help="take each so-manieth call")
    given = parser.parse_args()
    total = 0
    for name in given.writers or WRITERS:
        count, wrong = stopped(WRITERS[name], given.every)
        total += len(wrong)
        print("".join(f"    {text}\n" for text in wrong), end="", flush=True)
        show(f"{name}, stopped at {count} calls", f"{len(wrong)} wrong", "0")
    return total


if __name__ == "__main__":
    sys.exit(1 if main() else 0)
