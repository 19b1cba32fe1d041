"""Inputs that led to new code when coverage guided them, once more."""

import time
import warnings
import zipfile
from pathlib import Path

import pytest

import freqid as fq
from freqid.checks import InputError
from freqid.pages.explorer.state import State

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.zip"))
RESPONSES = ("response.csv", "response.mat", "response.s2p")
READERS = {"estimate.json": fq.load} | dict.fromkeys(RESPONSES, fq.read_response)


@pytest.mark.parametrize("path", CORPUS, ids=lambda p: p.stem)
def test_inputs_are_read_or_refused_by_name(path, tmp_path, benchmarks):
    from fuzz import passed

    name, plant = path.stem, fq.two_mass()
    read = passed if name.startswith("stream.") else READERS.get(name, fq.read)
    other = tmp_path / f"tried{Path(name).suffix}"
    outcomes, unnamed = {"read": 0, "refused": 0}, []
    with zipfile.ZipFile(path) as pack:
        contents = [pack.read(entry) for entry in pack.namelist()]
    for content in contents:
        begin = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                if name == "ties":
                    plant.tie(d=content.decode("utf-8", "replace"))
                elif name == "links":
                    State.of("?" + content.decode("utf-8", "replace")).code()
                else:
                    other.write_bytes(content)
                    read(other)
            outcomes["read"] += 1
        except InputError as error:
            outcomes["refused"] += 1
            if name not in ("ties", "links") and str(other) not in str(error):
                unnamed.append(str(error))
        assert time.perf_counter() - begin < 5
    assert not unnamed
    assert outcomes["read"], outcomes
    assert outcomes["refused"] or name == "links", outcomes


def test_there_is_a_corpus_for_every_kind():
    names = {p.stem for p in CORPUS}
    assert {"record.csv", "german.txt", "plain.mat", "packed.mat", "record.npz", "ties"} <= names
    assert {"stream.npy", "stream.parquet", "stream.h5", *RESPONSES} <= names
