"""The short version of the studies in ``benchmarks/trust``: a few cases of each."""

import pandas as pd
import pytest


@pytest.fixture(scope="module")
def studies(benchmarks):
    from trust import studies

    return studies


def test_every_fault_is_mostly_named_and_seldom_trusted(studies, tmp_path):
    table = pd.DataFrame([studies.named(case) for case in range(len(studies.FAULTS))])
    faulty = table[table["fault"] != "none"]
    assert (faulty["first"] == faulty["fault"]).mean() >= 0.7
    sound = table[table["fault"] == "none"]
    assert (sound["first"] == "none").all()
    studies.draw(table, tmp_path / "faults.png")
    assert (tmp_path / "faults.png").stat().st_size > 10_000


def test_loops_under_several_controllers(benchmarks):
    from trust import loops

    table = pd.DataFrame([loops.one(case) for case in (0, 4, 9, 14, 19, 23)])
    # six fits with two or three parameters: errors of one standard error, not of three
    assert table["square"].mean() < 3
    assert (table["grade"] == "trust").sum() >= 5
    assert len(list(loops.rows(table))) == table.groupby(["plant", "noise"]).ngroups


def test_every_cell_of_the_coverage_runs(studies):
    table = pd.DataFrame([studies.covered(case) for case in range(len(studies.CELLS))])
    assert set(table["cell"]) == set(studies.CELLS)
    assert table["held"].mean() > 0.6
