"""Inputs that coverage guides, with atheris: nothing but an InputError that names the file.

    pip install atheris
    python benchmarks/guided_fuzz.py                    a million inputs of each target: many hours
    python benchmarks/guided_fuzz.py --runs 20000 record.csv ties
    python benchmarks/guided_fuzz.py --seconds 60       a minute over all of them

Runs begin from ``tests/reliability/corpus``. What reached new code is kept in ``--out``, one folder
a target, and a run goes on from there; inputs that ended otherwise lie beside it. Printed for each
target: inputs, the slowest, the most memory, and how many ended otherwise. One that takes more than
five seconds, or more than 256 MiB at once, has.
"""

import argparse
import contextlib
import re
import subprocess
import sys
import tempfile
import warnings
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

# seconds and MiB that an input may take
SLOW, MOST = 5, 256
# what earlier runs have found, which the tests try once more
CORPUS = Path(__file__).resolve().parents[1] / "tests" / "reliability" / "corpus"
TEXTS = ("ties", "links")
# other programs' files that are read in this process
FOREIGN = ("response.mat", "response.s2p")
# failures after which a target is given up
_GIVEN_UP = 5


def _child(name, options):
    """One target in this process, until atheris ends it."""
    import atheris

    with atheris.instrument_imports(include=["freqid"]):
        import freqid as fq
        from freqid.checks import InputError
        from freqid.pages.explorer.state import State

    plant = fq.two_mass()
    folder = Path(tempfile.mkdtemp())
    paths = _files(folder)
    read = next((r for p, r in paths.items() if p.name == name), None)
    path = folder / f"tried{Path(name).suffix}"

    def tried(data):
        if name == "ties":
            plant.tie(d=data.decode("utf-8", "replace"))
        elif name == "links":
            State.of("?" + data.decode("utf-8", "replace")).code()
        else:
            path.write_bytes(data)
            read(path)

    def one(data):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                tried(data)
        except InputError as error:
            if name not in TEXTS and str(path) not in str(error):
                raise AssertionError(f"no path in: {error}") from error

    one(b"")
    atheris.Setup([sys.argv[0], *options], one)
    atheris.Fuzz()


def _files(folder):
    """Files, and what reads them."""
    import foreign_files
    import fuzz

    found = fuzz.corpus(folder)
    for name in FOREIGN:
        write, read = foreign_files.FILES[name]
        with contextlib.suppress(ImportError):
            write(folder / name)
            found[folder / name] = read
    return found


def _begun(name, kept):
    """Files, or texts, to begin from."""
    kept.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for path in _files(Path(folder)):
            if path.name == name:
                (kept / "first").write_bytes(path.read_bytes())
    known = CORPUS / f"{name}.zip"
    if known.exists():
        with zipfile.ZipFile(known) as pack:
            pack.extractall(kept)
    texts = {
        "ties": ["k/2 + Jm**2", "sqrt(k)*sin(2*pi*Ja)", "-(1e3)"],
        "links": ["plant=two-mass&hold=zoh&factor=10&x.k=1e5", "sine=3&noise=0.1&high=80"],
    }
    for i, text in enumerate(texts.get(name, ())):
        (kept / f"first{i}").write_text(text)


def _run(name, out, runs, seconds):
    """Inputs, failures, the slowest (s), the most memory (MiB) of one target."""
    kept, done, failed, slowest, most = out / name, 0, 0, 0, 0
    _begun(name, kept)
    length = max((p.stat().st_size for p in kept.iterdir()), default=100)
    while done < runs and failed < _GIVEN_UP:
        options = [
            str(kept), f"-runs={runs - done}", f"-timeout={SLOW}", f"-malloc_limit_mb={MOST}",
            "-rss_limit_mb=2048", f"-max_len={min(2 * length + 100, 100_000)}",
            "-print_final_stats=1", f"-artifact_prefix={out / name}.", f"-seed={done + 1}",
        ]  # fmt: skip
        if seconds:
            options.append(f"-max_total_time={seconds}")
        call = [sys.executable, __file__, "--child", name, *options]
        said = subprocess.run(call, capture_output=True, text=True, errors="replace", check=False)
        told = {k: int(v) for k, v in re.findall(r"stat::(\w+):\s+(\d+)", said.stderr)}
        done += max(told.get("number_of_executed_units", 0), 1)
        slowest = max(slowest, told.get("slowest_unit_time_sec", 0))
        most = max(most, told.get("peak_rss_mb", 0))
        if said.returncode:
            failed += 1
            print("    " + "\n    ".join(said.stderr.splitlines()[-25:]), flush=True)
        if seconds:
            break
    return done, failed, slowest, most


def main():
    from table import show

    with tempfile.TemporaryDirectory() as folder:
        names = [*(p.name for p in _files(Path(folder))), *TEXTS]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", choices=[*names, []], default=[])
    parser.add_argument("--runs", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=int, default=0, help="of all targets together")
    parser.add_argument("--out", type=Path, default=Path("fuzz_corpus"))
    parser.add_argument("--jobs", type=int, default=1, help="targets at a time")
    given = parser.parse_args()
    chosen, total = given.targets or names, 0
    each = max(given.seconds * given.jobs // len(chosen), 1) if given.seconds else 0
    with ThreadPoolExecutor(given.jobs) as pool:
        all_done = pool.map(lambda name: _run(name, given.out, given.runs, each), chosen)
        for name, (done, failed, slowest, most) in zip(chosen, all_done, strict=True):
            total += failed
            told = f"{name}, {done} inputs, slowest {slowest} s, {most} MiB"
            show(told, f"{failed} other", "0")
    return total


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        _child(sys.argv[2], sys.argv[3:])
    else:
        sys.exit(1 if main() else 0)
