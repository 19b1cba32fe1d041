"""The short version of the studies in ``benchmarks/trust``: a few cases of each."""

import pandas as pd
import pytest
import scipy.stats


@pytest.fixture(scope="module")
def studies(benchmarks):
    from trust import studies

    return studies


@pytest.mark.study
def test_every_fault_is_mostly_named_and_seldom_trusted(studies, tmp_path):
    table = pd.DataFrame([studies.named(case) for case in range(len(studies.FAULTS))])
    faulty = table[table["fault"] != "none"]
    assert (faulty["first"] == faulty["fault"]).mean() >= 0.7
    sound = table[table["fault"] == "none"]
    assert (sound["first"] == "none").all()
    studies.draw(table, tmp_path / "faults.png")
    assert (tmp_path / "faults.png").stat().st_size > 10_000


@pytest.mark.study
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


@pytest.mark.study
def test_faults_as_weak_as_may_be_are_mostly_named(benchmarks):
    from trust import strengths

    # a test of one number, from both ends of the normal distribution
    ends = scipy.stats.norm.isf(strengths.LEVEL / 2) + scipy.stats.norm.isf(1 - strengths.POWER)
    assert strengths.needed(1) == pytest.approx(ends**2, rel=1e-3)
    assert strengths.needed(1, places=100) > strengths.needed(1)
    table = pd.DataFrame([strengths.threshold(case) for case in (0, 1, 4, 6, 7)])
    assert (table["grade"] != "absorbed").all()
    assert table["named"].sum() >= 4
    assert len(list(strengths.rows(table))) == 5
