"""The short version of the studies in ``benchmarks/search``: a few cases of each."""

import sys
from pathlib import Path

import pandas as pd
import pytest


@pytest.fixture(scope="module")
def studies():
    folder = Path(__file__).resolve().parents[2] / "benchmarks"
    sys.path.insert(0, str(folder))
    try:
        from search import minima, orders, store, witness

        yield minima, orders, store, witness
    finally:
        sys.path.remove(str(folder))


def test_a_study_goes_on_where_it_was_interrupted(studies, tmp_path):
    store, calls = studies[2], []

    def one(case):
        calls.append(case)
        return {"twice": 2 * case}

    store.resumed(tmp_path / "x.csv", range(3), one)
    table = store.resumed(tmp_path / "x.csv", range(5), one)
    assert calls == [0, 1, 2, 3, 4]
    assert table["twice"].tolist() == [0, 2, 4, 6, 8]


def test_random_plants_are_found_or_doubted(studies):
    minima = studies[0]
    table = pd.DataFrame([minima.one(case) for case in range(3000, 3012)])
    told = table[table["spread"] < minima.DETERMINED]
    assert len(told) > 6
    lost = told["cost"] > told["best"] * (1 + minima.WORSE)
    assert lost.sum() <= 1
    assert not (lost & (told["verdict"] == "complete")).any()
    assert (table["cost"] <= table["own"] * (1 + 1e-6)).all()


def test_orders_and_witness(studies):
    _, orders, _, witness = studies
    assert [orders.one(case)["mdl"] for case in range(3)] == [4, 4, 4]
    assert all(0 <= witness.one(case)["p"] <= 1 for case in range(4))
