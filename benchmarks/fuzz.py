"""Damaged files, links and expressions: nothing but a ValueError that names the place.

    python benchmarks/fuzz.py [inputs a target, 2000] [first seed, 0]

Each target starts from files that its own writers, or libraries of other programs, made and
changes, cuts, repeats or swaps bytes of them; a seed says which. Targets run in processes of their
own, so that an end of the interpreter is seen, and said with its seed; a longer run goes on where
another ended. Printed for each target: how many inputs were read, refused, or ended otherwise, the
slowest, and the most memory.
"""

import collections
import multiprocessing
import random
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import scipy.io

import freqid as fq
from freqid.checks import InputError

sys.path.insert(0, str(Path(__file__).parent))
import foreign_files
from table import show

# seconds that an input may take
SLOW = 5.0


def corpus(folder):
    """Files by name, and what reads them."""
    t = 0.01 * np.arange(60)
    record = fq.Record(np.sin(t), np.cos(t), 0.01, notes=("made here",))
    for kind in (".csv", ".npz", ".parquet"):
        fq.write(record, folder / f"record{kind}")
    rows = "\n".join(f"{x:g};{np.sin(x):g};{np.cos(x):g}".replace(".", ",") for x in t)
    (folder / "german.txt").write_text("Zeit [s];u;y\n" + rows, encoding="utf-8")
    arrays = {"time": t, "u": record.u, "y": record.y, "s": {"a": t, "b": "text"}}
    scipy.io.savemat(folder / "plain.mat", arrays)
    scipy.io.savemat(folder / "packed.mat", arrays, do_compression=True)
    for name, fields in logged_structures(t, record.u, record.y).items():
        scipy.io.savemat(folder / f"{name}.mat", {"log": fields})
    try:
        import h5py
    except ImportError:
        pass
    else:
        with h5py.File(folder / "record.h5", "w") as file:
            file["time"], file["u"], file["y"] = t, record.u, record.y
    np.save(folder / "stream.npy", np.column_stack([record.u, record.y]).astype("f4"))
    for kind in ("parquet", "h5"):
        if (folder / f"record.{kind}").exists():
            (folder / f"stream.{kind}").write_bytes((folder / f"record.{kind}").read_bytes())
    fq.etfe(record).to_frame().to_csv(folder / "response.csv", index=False)
    fq.fit(fq.first_order(), record).save(folder / "estimate.json")
    readers = {"response.csv": fq.read_response, "estimate.json": fq.load}
    usual = {"record": fq.read, "stream": passed}
    return {
        path: readers.get(path.name, usual.get(path.stem, fq.read))
        for path in sorted(folder.iterdir())
    }


def logged_structures(t, u, y):
    """As a block of Simulink and a recorder of dSPACE write them."""
    signals = np.zeros(2, dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    signals[:] = [(u, 1, "u"), (y, 1, "y")]
    axes = np.zeros(1, dtype=[("Name", "O"), ("Data", "O")])
    axes[:] = [("time", t)]
    channels = np.zeros(2, dtype=[("Name", "O"), ("Data", "O"), ("Unit", "O"), ("XIndex", "O")])
    channels[:] = [("u", u, "Nm", 1), ("y", y, "rad", 1)]
    return {"block": {"time": t, "signals": signals}, "recorder": {"X": axes, "Y": channels}}


def passed(path):
    """A pass over a file that is read block by block."""
    own = {"dt": 0.01, "columns": ["u", "y"]} if path.suffix == ".npy" else {}
    return fq.open(path, "u", "y", block=25, **own).load()


def damaged(raw, r):
    """The bytes with some changed, cut out, doubled, or the end missing."""
    content = bytearray(raw)
    for _ in range(r.choice([1, 1, 1, 2, 5, 20])):
        at = r.randrange(len(content))
        way = r.random()
        if way < 0.7:
            content[at] = r.randrange(256)
        elif way < 0.8:
            content[at : at + r.randrange(1, 9)] = b""
        elif way < 0.9:
            content[at:at] = content[at : at + r.randrange(1, 40)]
        else:
            content[at] = r.choice(b"\x00\xff\x7f\x80\n,;-9eE\"'")
        content = content or bytearray(b"0")
    return bytes(content[: r.randrange(1, len(content) + 1)] if r.random() < 0.1 else content)


def tries(path, read, seeds, queue):
    """Read as many damaged copies as there are seeds; each outcome is put into the queue."""
    raw, other = path.read_bytes(), path.with_name(f"damaged{path.suffix}")
    for seed in seeds:
        other.write_bytes(damaged(raw, random.Random(seed)))
        begin, outcome = time.perf_counter(), "read"
        queue.put((seed, None, 0.0, 0))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                read(other)
        except InputError as error:
            outcome = "refused" if str(other) in str(error) else f"no path in {error}"
        except BaseException as error:
            outcome = f"{type(error).__name__}: {error}"
        took = time.perf_counter() - begin
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        queue.put((seed, outcome, took, memory))


def file_target(path, read, seeds):
    outcomes, slowest, most, at = collections.Counter(), 0.0, 0, seeds.start
    while at < seeds.stop:
        queue = multiprocessing.SimpleQueue()
        worker = multiprocessing.Process(
            target=tries, args=(path, read, range(at, seeds.stop), queue)
        )
        worker.start()
        while worker.is_alive() or not queue.empty():
            while not queue.empty():
                seed, outcome, took, memory = queue.get()
                at = seed + 1
                if outcome is not None:
                    outcomes[outcome] += 1
                    slowest, most = max(slowest, took), max(most, memory)
            time.sleep(0.01)
        worker.join()
        if worker.exitcode:
            outcomes[f"seed {at - 1} ended the interpreter ({worker.exitcode})"] += 1
    return outcomes, slowest, most


def expression_target(seeds):
    # fmt: off
    pieces = ["k", "Jm", "Ja", "1", "2.5", "1e9", "+", "-", "*", "/", "**", "(", ")", ",", "sqrt(",
              "exp(", "open(", "loadtxt(", "__import__(", "'a'", "[", "]", "lambda", ":", ".", "=",
              " ", "if", "else", "for", "in", "9" * 40, "{", "}", "@", "~", "not", "\n"]
    # fmt: on
    plant, outcomes, slowest = fq.two_mass(), collections.Counter(), 0.0
    for seed in seeds:
        r = random.Random(seed)
        text = "".join(r.choice(pieces) for _ in range(r.choice([1, 3, 5, 8, 30])))
        begin = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                plant.tie(d=text)
            outcomes["read"] += 1
        except InputError:
            outcomes["refused"] += 1
        except BaseException as error:
            outcomes[f"{type(error).__name__}: {error} ({text!r})"] += 1
        slowest = max(slowest, time.perf_counter() - begin)
    return outcomes, slowest, 0


def link_target(seeds):
    from freqid.pages.explorer.state import State

    # fmt: off
    pieces = ["plant=", "two-mass", "hold=", "zoh", "&", "factor=", "1e9", "nan", "-1", "sine=",
              "x.k=", "%", "=", "a", "high=", "low=", "noise=", "0", "inf", "\x00", "?"]
    # fmt: on
    outcomes, slowest = collections.Counter(), 0.0
    for seed in seeds:
        r = random.Random(seed)
        text = "?" + "".join(r.choice(pieces) for _ in range(r.choice([1, 3, 8, 20])))
        begin = time.perf_counter()
        try:
            State.of(text).code()
            outcomes["read"] += 1
        except BaseException as error:
            outcomes[f"{type(error).__name__}: {error} ({text!r})"] += 1
        slowest = max(slowest, time.perf_counter() - begin)
    return outcomes, slowest, 0


def main(count=2000, first=0):
    seeds, failed = range(first, first + count), 0
    with tempfile.TemporaryDirectory() as folder:
        targets = corpus(Path(folder)) | foreign_files.written(Path(folder))
        found = {p.name: file_target(p, read, seeds) for p, read in targets.items()}
    found |= {"ties": expression_target(seeds), "links": link_target(seeds)}
    for name, (outcomes, slowest, most) in found.items():
        other = {k: n for k, n in outcomes.items() if k not in ("read", "refused")}
        failed += sum(other.values()) + (slowest > SLOW)
        told = (
            f"{outcomes['read']} read, {outcomes['refused']} refused, {sum(other.values())} other"
        )
        show(f"{name}, {count} inputs, slowest {slowest:.2f} s, {most} MiB", told, "0 other")
        for text, n in list(other.items())[:5]:
            print(f"    {n} times {text[:150]}")
    return failed


if __name__ == "__main__":
    sys.exit(1 if main(*(int(a) for a in sys.argv[1:3])) else 0)
