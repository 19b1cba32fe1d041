"""Changes in a fleet's table: found where there is one, and at the stated level where none is."""

import numpy as np
import pandas as pd
import polars as pl
import pytest

import freqid as fq


def fleet(seed, rows=60, spread=2.0, scatter=0.5):
    """Rows without a change: standard errors within a factor, and a scatter beside them."""
    rng = np.random.default_rng(seed)
    std = spread ** rng.uniform(-1, 1, rows)
    own = std * rng.standard_normal(rows) + scatter * rng.standard_normal(rows)
    return pd.DataFrame({"k": 100 + own, "k_std": std})


def marked(table, **options):
    return np.flatnonzero(fq.fleet_alarms(table, "k", **options)).tolist()


@pytest.mark.study
@pytest.mark.parametrize(("rows", "spread", "scatter"), [
    (6, 2.0, 0.5), (10, 10.0, 1.0), (30, 10.0, 0.0), (60, 2.0, 0.5),
])  # fmt: skip
def test_the_level_is_kept(rows, spread, scatter):
    """At 10 %, so that fifty fleets tell: more than eleven of them in one of 100 such tests."""
    false = [bool(marked(fleet([s, rows], rows, spread, scatter), level=0.1)) for s in range(50)]
    assert np.sum(false) <= 11


@pytest.mark.study
def test_a_single_row():
    found = []
    for seed in range(20):
        table = fleet(seed)
        table.loc[7, "k"] += 12 * table["k_std"][7]
        found.append(7 in marked(table))
    assert np.mean(found) > 0.9


@pytest.mark.study
@pytest.mark.parametrize("size", [3, 8, 50])
@pytest.mark.parametrize("begin", [18, 30, 50])
def test_a_lasting_change(size, begin):
    """However many rows it takes, and however large it is."""
    before, after = [], []
    for seed in range(8):
        table = fleet([seed, begin], spread=1.5)
        table.loc[begin:, "k"] += size
        found = marked(table)
        before.append(sum(i < begin - 1 for i in found) / begin)
        after.append(sum(i >= begin for i in found) / (60 - begin))
    assert np.mean(after) > 0.9
    assert np.mean(before) < 0.05


def test_a_drift_and_a_change_that_goes_again():
    table = fleet(3)
    table["k"] += np.linspace(0, 30, 60)
    found = marked(table)
    assert set(range(30, 60)) <= set(found)
    assert not set(range(5)) & set(found)
    table = fleet(4)
    table.loc[20:39, "k"] += 6
    assert set(marked(table)) == set(range(20, 40))


def test_machines_are_compared_with_themselves():
    tables = [fleet([1, s], 30).assign(machine=f"m{s}", day=np.arange(30)) for s in range(4)]
    for i, table in enumerate(tables):
        table["k"] += 50 * i
    tables[2].loc[20:, "k"] += 10
    # by day, as a fleet is logged
    mixed = pd.concat(tables).sort_values("day", kind="stable", ignore_index=True)
    found = mixed.loc[marked(mixed, machine="machine")]
    assert set(found["machine"]) == {"m2"}
    assert set(found["day"]) == set(range(20, 30))
    # whatever the order of the rows
    turned = mixed.sample(frac=1, random_state=0, ignore_index=True)
    again = turned.loc[marked(turned, machine="machine", by="day")]
    assert set(again["day"]) == set(range(20, 30))


def test_rows_that_failed_and_rows_without_errors():
    table = fleet(5).assign(day=pd.Timestamp("2026-01-01") + pd.to_timedelta(np.arange(60), "D"))
    table.loc[[3, 9], "k"] = np.nan
    table.loc[40:, "k"] += 8
    assert marked(table, by="day") == list(range(40, 60))
    exact = table.assign(k_std=0.0)
    assert set(range(40, 60)) <= set(marked(exact))
    exact.loc[12, "k"] = 1e6
    assert 12 in marked(exact)
    assert marked(pd.DataFrame({"k": [1.0] * 20, "k_std": 0.0})) == []


@pytest.mark.study
@pytest.mark.parametrize("spread", [0.4, 1.0])
@pytest.mark.parametrize("rows", [5, 8, 12])
def test_rounded_values_are_no_changes(rows, spread):
    """Most of them are the same, beside which each other one looked like a change."""
    false = 0
    for seed in range(50):
        values = np.round(10 + spread * np.random.default_rng(seed).standard_normal(rows))
        false += bool(marked(pd.DataFrame({"k": values, "k_std": 0.01})))
    assert false <= 4


def test_what_is_refused():
    table = fleet(1)
    for missing in (np.nan, None, pd.NA):
        for kind in (object, "string"):
            given = pd.Series(["a"] * 57 + [missing] * 3, dtype=kind)
            with pytest.raises(ValueError, match="machine='m': row 57 has none"):
                fq.fleet_alarms(table.assign(m=given), "k", machine="m")
    with pytest.raises(ValueError, match="have no order"):
        fq.fleet_alarms(table.assign(day=[3, "a"] * 30), "k", by="day")
    with pytest.raises(ValueError, match="k_std=-1 in row 0"):
        fq.fleet_alarms(table.assign(k_std=-1.0), "k")
    for level in (0, 1, 2, -1, np.nan):
        with pytest.raises(ValueError, match="level"):
            fq.fleet_alarms(table, "k", level=level)
    with pytest.raises(ValueError, match="parameter='q'"):
        fq.fleet_alarms(table, "q")
    with pytest.raises(ValueError, match="by='day'"):
        fq.fleet_alarms(table, "k", by="day")
    with pytest.raises(ValueError, match="machine='robot'"):
        fq.fleet_alarms(table, "k", machine="robot")
    with pytest.raises(ValueError, match="fewer than three"):
        fq.fleet_alarms(table[:2], "k")
    with pytest.raises(ValueError, match="no column k_std"):
        fq.fleet_alarms(table.drop(columns="k_std"), "k")
    with pytest.raises(ValueError, match="holds no numbers"):
        fq.fleet_alarms(table.assign(k="stiff"), "k")
    with pytest.raises(ValueError, match=r"a table of polars; give table.to_pandas\(\)"):
        fq.fleet_alarms(pl.from_pandas(table[["k", "k_std"]]), "k")
    with pytest.raises(ValueError, match="row 4 has none"):
        fq.fleet_alarms(
            table.assign(day=[np.nan if i == 4 else i for i in range(60)]), "k", by="day"
        )


@pytest.mark.parametrize("rows", [1, 2])
def test_the_first_days_of_a_fleet_are_drawn(rows):
    axes = fq.plot_fleet(fleet([2, 0], 20)[:rows], "k")
    assert f"{rows} fits" in axes.get_title()
    for name in ("by", "machine"):
        with pytest.raises(ValueError, match=f"{name}='day'"):
            fq.plot_fleet(fleet([2, 0], 20)[:rows], "k", **{name: "day"})


def test_the_picture_of_machines():
    tables = [fleet([2, s], 20).assign(machine=f"m{s}", day=np.arange(20)) for s in range(3)]
    tables[1].loc[12:, "k"] += 9
    ax = fq.plot_fleet(pd.concat(tables, ignore_index=True), "k", by="day", machine="machine")
    assert [t.get_text() for t in ax.texts] == ["m0", "m1", "m2"]
    labels = [t.get_text() for t in ax.get_legend().get_texts()]
    assert labels == ["changed (8 of 60; level 0.01 for all)"]


def machines(seed, count, rows, scatter=1.0, step=0.0):
    """Rows of many machines whose bars are 1, the first of which steps after half of its rows."""
    x = 100 + scatter * np.random.default_rng(seed).standard_normal((count, rows))
    x[0, rows // 2 :] += step
    m = np.repeat(np.arange(count), rows)
    return pd.DataFrame({"m": m, "k": x.ravel(), "k_std": 1.0})


@pytest.mark.study
@pytest.mark.parametrize(("count", "rows", "step"), [(50, 16, 20), (10, 12, 20), (100, 10, 50)])
def test_a_step_of_one_of_many_machines(count, rows, step):
    """So few orders are no rarer than the level of one of them: none of these had been seen."""
    seen = marked(machines(3, count, rows, step=step), machine="m")
    assert set(range(rows // 2, rows)) <= set(seen)
    assert set(seen) <= set(range(rows))


def test_machines_without_alarms_share_no_level():
    alone = machines(5, 1, 16, step=20)
    beside = machines(6, 50, 1).assign(m=lambda t: t["m"] + 1)
    assert marked(pd.concat([alone, beside], ignore_index=True), machine="m") == list(range(8, 16))


@pytest.mark.study
def test_few_rows_of_many_machines_keep_the_level():
    """Where bars are 3 times too small: 9 of 10 fleets had been marked."""
    assert not any(marked(machines(s, 60, 5, scatter=3.0), machine="m") for s in range(10))


def test_the_order_of_a_column():
    months = ["Oct", "Nov", "Dec", "Jan"]
    rows = machines(7, 1, 36, step=8).sample(frac=1, random_state=1)
    at = pd.Categorical.from_codes(rows.index // 9, months, ordered=True)
    assert sorted(marked(rows.assign(by=at), by="by")) == np.flatnonzero(rows.index >= 18).tolist()
    days = pd.date_range("2026-09-20", periods=36)
    iso = days[rows.index].strftime("%Y-%m-%d")
    assert len(marked(rows.assign(by=iso), by="by")) == 18
    with pytest.raises(ValueError, match="whose order is not that of time"):
        fq.fleet_alarms(rows.assign(by=days[rows.index].strftime("%d.%m.%Y")), "k", by="by")


def test_texts_in_the_order_of_their_numbers():
    rows = machines(7, 1, 36, step=8)
    runs = rows.assign(at=[f"run_{i}" for i in range(36)]).sample(frac=1, random_state=2)
    assert sorted(runs["at"].iloc[marked(runs, by="at")]) == sorted(
        f"run_{i}" for i in range(18, 36)
    )
    axis = fq.plot_fleet(runs, "k", by="at")
    assert [t.get_text() for t in axis.get_xticklabels()][:2] == ["run_0", "run_5"]
    months = pd.Categorical.from_codes(runs.index // 9, ["Oct", "Nov", "Dec", "Jan"], ordered=True)
    axis = fq.plot_fleet(runs.assign(at=months), "k", by="at")
    assert [t.get_text() for t in axis.get_xticklabels()] == ["Oct", "Nov", "Dec", "Jan"]
    with pytest.raises(ValueError, match="order is not that of time"):
        fq.fleet_alarms(runs.assign(at=months.astype(str)), "k", by="at")


def test_days_as_texts_are_dates():
    """As a CSV gives them: KeyError in the plot."""
    runs = fleet([2, 0], 20)
    days = pd.date_range("2026-01-01", periods=len(runs))
    left, right = (
        fq.plot_fleet(runs.assign(at=at), "k", by="at").dataLim.intervalx
        for at in (days, days.astype(str))
    )
    assert np.ptp(left) == len(runs) - 1
    assert np.array_equal(left, right)
