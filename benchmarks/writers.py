"""What freqid writes: how each file comes about, and whether it is as it was or as it should be."""

import functools
import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import freqid as fq
from freqid.cli.commands import main

PLANT = fq.first_order()


@functools.cache
def _record(seed):
    """A short record of the plant."""
    u = fq.chirp(2, 40, 1, 5e-3)
    return fq.simulate(PLANT, u, 5e-3).with_noise(0.01, seed=seed)


def _alike(a, b):
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


@dataclass(frozen=True)
class Written:
    """A file written over an older one, by ``write(path, content)``, and told by ``read(path)``."""

    name: str
    write: object
    read: object

    def prepare(self, folder):
        for content in (0, 1):
            fq.write(_record(content), folder / f"in{content}.npz")
        self.write(folder / self.name, 0)

    def act(self, folder):
        self.write(folder / self.name, 1)
        return True

    def check(self, folder):
        seen = self.read(folder / self.name)
        for content in (0, 1):
            self.write(folder / f"whole-{self.name}", content)
            if _alike(seen, self.read(folder / f"whole-{self.name}")):
                return True
        return f"neither the old nor the new: {len(seen)}"


@dataclass(frozen=True)
class Resumed:
    """A job that goes on where it was stopped, by ``run(folder, path)``: numbers."""

    name: str
    run: object
    begin: object = None

    def prepare(self, folder):
        if self.begin:
            self.begin(folder)

    def act(self, folder):
        self.run(folder, folder / self.name)
        return True

    def check(self, folder):
        (folder / "other").mkdir()
        again = self.run(folder, folder / self.name)
        whole = self.run(folder, folder / "other" / self.name)
        return True if np.array_equal(again, whole) else f"{again} instead of {whole}"


@functools.cache
def _estimate(seed):
    return fq.fit(PLANT, _record(seed))


def _command(*words):
    """A command line; ValueError with what it says when it fails."""
    said = io.StringIO()
    with redirect_stdout(io.StringIO()), redirect_stderr(said):
        try:
            main([str(w) for w in words])
        except SystemExit as end:
            if end.code:
                raise ValueError(f"exit {end.code}: {said.getvalue()}") from end


def _spectrum(path, content, option="--out"):
    _command("frf", path.parent / f"in{content}.npz", option, path, "--force")


def _log(folder):
    rng = np.random.default_rng(0)
    np.save(folder / "log.npy", rng.standard_normal((3000, 2)))


def _averaged(folder, path):
    stream = fq.open(
        folder / "log.npy", inputs="u", outputs="y", dt=0.01, columns=["u", "y"], block=500
    )
    return fq.h1(stream, segment=500, state=path).response


def _fleet(folder, path):
    records = {f"r{i}": _record(i) for i in range(4)}
    return fq.fit_many(PLANT, records, path, chunk=2, n_jobs=1, verdicts=False)["b"].to_numpy()


def _map(folder, path):
    spectra = {"white": fq.WhiteSpectrum()}
    table = fq.bias_map(PLANT, spectra, [1, 2], path=path, base_dt=5e-3, n_jobs=1, chunk=2)
    return table.select_dtypes("number").to_numpy()


def _read(path):
    record = fq.read(path)
    return [record.u, record.y]


def _loaded(path):
    est = fq.load(path)
    return [est.values, est.cost]


def text_of(path):
    return [np.frombuffer(Path(path).read_bytes(), np.uint8)]


WRITERS = {
    w.name: w
    for w in (
        *(Written(f"record.{k}", lambda p, c: fq.write(_record(c), p, overwrite=True), _read)
          for k in ("csv", "npz", "parquet")),
        Written("estimate.json", lambda p, c: _estimate(c).save(p, overwrite=True), _loaded),
        Written("response.csv", _spectrum, text_of),
        Written("bode.png", lambda p, c: _spectrum(p, c, "--plot"), text_of),
        Resumed("sums.npz", _averaged, _log),
        Resumed("fleet.parquet", _fleet),
        Resumed("map.parquet", _map),
    )
}  # fmt: skip
