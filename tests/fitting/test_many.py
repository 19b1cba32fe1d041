"""Many fits: rows, failures, resumption, lost workers, alarms, pictures."""

import dataclasses
import os
import signal
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.cli import commands

LAG = fq.first_order(b=50, a=20)


def runs(count, noise=0.01, samples=400):
    out = []
    for seed in range(count):
        record = fq.simulate(LAG, fq.white_noise(samples, seed=seed), 0.01)
        out.append(record.with_noise(noise, seed=seed))
    return out


def same(a, b):
    pd.testing.assert_frame_equal(a.drop(columns="seconds"), b.drop(columns="seconds"))


def test_a_row_is_the_fit(tmp_path):
    records = runs(5)
    table = fq.fit_many(LAG, records, band=(0.5, 40))
    assert list(table.columns) == [
        "name", "b", "a", "b_std", "a_std", "cost", "fit_percent", "converged", "verdict",
        "witness", "warnings", "seconds", "error",
    ]  # fmt: skip
    one = fq.fit(LAG, records[3], band=(0.5, 40))
    row = table.iloc[3]
    # records of one shape are done together, and come to the same minimum another way
    assert row["a"] == pytest.approx(one["a"], rel=1e-9)
    assert row["a_std"] == pytest.approx(one.parameters["std"]["a"], rel=1e-6)
    assert row["verdict"] == one.verdict.grade
    assert (table["error"] == "").all()
    quick = fq.fit_many(LAG, records, band=(0.5, 40), verdicts=False)
    assert "verdict" not in quick
    assert quick["a"].tolist() == pytest.approx(table["a"].tolist(), rel=1e-7)


def test_failures_are_rows(tmp_path):
    fq.write(runs(1)[0], tmp_path / "good.csv")
    (tmp_path / "bad.csv").write_text("time,u,y\n")
    flat = fq.Record(np.ones(50), np.zeros(50), 0.01)
    table = fq.fit_many(
        LAG, {"good": tmp_path / "good.csv", "bad": tmp_path / "bad.csv", "flat": flat,
              "none": tmp_path / "none.csv"},
    )  # fmt: skip
    assert table["name"].tolist() == ["good", "bad", "flat", "none"]
    assert table["error"][0] == ""
    assert "no samples" in table["error"][1]
    assert (table["error"][1:] != "").all()
    assert table["a"].isna().tolist() == [False, True, True, True]


@pytest.mark.parametrize("verdicts", [True, False])
def test_a_fleet_of_which_nothing_could_be_fitted_has_the_columns_of_one_that_could(
    tmp_path, verdicts
):
    asked = {"verdicts": verdicts, "n_jobs": 1}
    good = fq.fit_many(LAG, runs(2), **asked)
    path = tmp_path / "t.parquet"
    for _ in range(2):
        bad = fq.fit_many(LAG, runs(2), path, band=(1e6, 2e6), **asked)
        assert list(bad.columns) == list(good.columns)
        assert bad["a"].isna().all()
        assert bad["error"].str.contains("Nyquist").all()
    with pytest.raises(ValueError, match="no row was fitted"):
        fq.plot_fleet(bad, "a")


def test_processes_give_the_same_rows(tmp_path):
    records = runs(20, samples=150)
    alone = fq.fit_many(LAG, records, n_jobs=1, verdicts=False)
    same(alone, fq.fit_many(LAG, records, tmp_path / "t.parquet", n_jobs=2, verdicts=False))
    # a finished table is read back
    begun = (tmp_path / "t.parquet").stat().st_mtime_ns
    same(alone, fq.fit_many(LAG, records, tmp_path / "t.parquet", n_jobs=2, verdicts=False))
    assert (tmp_path / "t.parquet").stat().st_mtime_ns == begun
    with pytest.raises(ValueError, match="other fits"):
        fq.fit_many(LAG, records[1:], tmp_path / "t.parquet", verdicts=False)
    with pytest.raises(ValueError, match="other fits"):
        fq.fit_many(LAG, records, tmp_path / "t.parquet", band=(1, 20), verdicts=False)


def lag_that_dies(marker, b, a):
    """The lag; the first process that is told to dies in the middle."""
    if marker.exists() and os.getpid() != int(marker.read_text()):
        marker.unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    return [[-a]], [[b]], [[1.0]], None


@pytest.mark.study
def test_a_killed_worker_loses_no_row(tmp_path):
    from functools import partial

    marker = tmp_path / "kill"
    plant = fq.GreyBox(partial(lag_that_dies, marker), LAG.parameters)
    records = runs(24, samples=100)
    alone = fq.fit_many(plant, records, n_jobs=1, verdicts=False)
    marker.write_text(str(os.getpid()))
    found = fq.fit_many(plant, records, n_jobs=2, verdicts=False, chunk=3)
    assert not marker.exists()
    same(alone, found)


def test_an_interrupted_job_goes_on(tmp_path, monkeypatch):
    from freqid.fitting.many import rows

    records, path = runs(12, samples=100), tmp_path / "t.parquet"
    whole = fq.fit_many(LAG, records, n_jobs=1, verdicts=False)
    real, calls = rows._fitted, []

    def interrupted(task, name, *data):
        calls.append(name)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return real(task, name, *data)

    monkeypatch.setattr(rows, "_fitted", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fq.fit_many(LAG, records, path, n_jobs=1, verdicts=False, chunk=2)
    assert not path.exists()
    again = []
    monkeypatch.setattr(rows, "_fitted", lambda *a: again.append(a[1]) or real(*a))
    same(whole, fq.fit_many(LAG, records, path, n_jobs=1, verdicts=False, chunk=2))
    # three chunks of two had been finished
    assert len(again) == 6
    assert path.exists()
    assert [p.name for p in tmp_path.iterdir()] == ["t.parquet"]


def test_any_change_is_another_job(tmp_path):
    records, path = runs(3, samples=100), tmp_path / "t.parquet"
    asked = {"n_jobs": 1, "verdicts": False}
    fq.fit_many(LAG, records, path, **asked)
    r = records[1]
    changed = [
        (LAG.with_values(a=70), records, {}),
        (LAG.with_bounds(a=(1, 1000)), records, {}),
        (LAG, [records[0], r.with_hold("foh"), records[2]], {}),
        (LAG, [records[0], r.with_conditions(a=60.0), records[2]], {}),
        (LAG, [records[0], dataclasses.replace(r, reference=r.u), records[2]], {}),
        (LAG, [records[0], r.with_noise(1e-9), records[2]], {}),
        (LAG, records, {"band": (1, 100)}),
        (LAG, records, {"weights": [np.ones((1, 51))]}),
        (LAG, records, {"reading": {"dt": 1.0}}),
    ]
    for model, data, options in changed:
        with pytest.raises(ValueError, match="other fits"):
            fq.fit_many(model, data, path, **asked, **options)
    first = fq.fit_many(LAG, records, tmp_path / "w.parquet", weights=[np.ones((1, 51))], **asked)
    weights = [np.linspace(1, 2, 51)[None]]
    with pytest.raises(ValueError, match="other fits"):
        fq.fit_many(LAG, records, tmp_path / "w.parquet", weights=weights, **asked)
    again = fq.fit_many(LAG, records, tmp_path / "w.parquet", weights=[np.ones((1, 51))], **asked)
    pd.testing.assert_frame_equal(first, again)


def test_a_plant_that_differs_elsewhere_is_another(tmp_path):
    def plant(power):
        def matrices(a):
            return [[-(60 * (a / 60) ** power)]], [[1.0]], [[1.0]], None

        return fq.GreyBox(matrices, [fq.Parameter("a", 60.0)])

    records, path = runs(2, samples=100), tmp_path / "t.parquet"
    fq.fit_many(plant(1), records, path, n_jobs=1, verdicts=False)
    with pytest.raises(ValueError, match="other fits"):
        fq.fit_many(plant(3), records, path, n_jobs=1, verdicts=False)


def test_a_table_inside_a_plant_is_part_of_it(tmp_path):
    table = {0: 1.0, 1: 2.0, 2: 3.0}

    def matrices(a, mode):
        return [[-a * table[mode]]], [[100.0]], [[1.0]], None

    plant = fq.GreyBox(matrices, [fq.Parameter("a", 60.0)], conditions={"mode": 0})
    records = [r.with_conditions(mode=m) for m, r in enumerate(runs(3))]
    fq.fit_many(plant, records, tmp_path / "t.parquet", n_jobs=1, verdicts=False)
    fq.fit_many(plant, records, tmp_path / "t.parquet", n_jobs=1, verdicts=False)
    table[2] = 6.0
    with pytest.raises(ValueError, match="other fits"):
        fq.fit_many(plant, records, tmp_path / "t.parquet", n_jobs=1, verdicts=False)


def test_a_plant_that_fails_is_a_row():
    def matrices(a, load):
        if load > 1:
            raise RuntimeError("no licence")
        return [[-a]], [[100.0]], [[1.0]], None

    plant = fq.GreyBox(matrices, [fq.Parameter("a", 60.0)], conditions={"load": 0.0})
    first, second = runs(2)
    table = fq.fit_many(plant, [first, second.with_conditions(load=2.0)], n_jobs=1)
    assert table["error"][0] == ""
    assert "no licence" in table["error"][1]


@pytest.mark.study
def test_on_a_cluster(two_workers):
    records = runs(12, samples=100)
    alone = fq.fit_many(LAG, records, n_jobs=1, verdicts=False)
    with two_workers():
        same(alone, fq.fit_many(LAG, records, n_jobs=2, verdicts=False, chunk=3))


def test_a_finished_table_comes_in_the_order_of_the_call(tmp_path):
    """Or a column that is put beside it belongs to other rows."""
    records = {f"axis {i}": r for i, r in enumerate(runs(4))}
    path = tmp_path / "t.parquet"
    first = fq.fit_many(LAG, records, path, verdicts=False, n_jobs=1)
    turned = dict(reversed(records.items()))
    again = fq.fit_many(LAG, turned, path, verdicts=False, n_jobs=1)
    assert again["name"].tolist() == list(turned)
    same(first, again[::-1].reset_index(drop=True))
    with pytest.raises(ValueError, match=r"a row 'axis 3', which is not asked for"):
        fq.fit_many(LAG, {n: records[n] for n in list(records)[:3]}, path, verdicts=False)


@pytest.mark.parametrize("verdicts", [True, False])
def test_tied_parameters_have_columns_as_they_have_rows(verdicts):
    plant = LAG.tie(b="2.5 * a")
    records = [fq.simulate(plant, r.u, r.dt).with_noise(0.05, seed=1) for r in runs(3)]
    table = fq.fit_many(plant, records, verdicts=verdicts, n_jobs=1)
    one = fq.fit(plant, records[1]).parameters
    for name in ("a", "b"):
        assert table[name][1] == pytest.approx(one["value"][name], rel=1e-6)
        assert table[f"{name}_std"][1] == pytest.approx(one["std"][name], rel=1e-4)


def test_patterns_and_series_name_their_records(tmp_path):
    for i in (2, 10):
        fq.write(runs(1)[0], tmp_path / f"run{i}.csv")
    asked = {"verdicts": False, "n_jobs": 1}
    table = fq.fit_many(LAG, str(tmp_path / "run*.csv"), **asked)
    assert [name.rsplit("/")[-1] for name in table["name"]] == ["run2.csv", "run10.csv"]
    with pytest.raises(FileNotFoundError, match="nothing"):
        fq.fit_many(LAG, [tmp_path / "nothing*.csv"], **asked)
    named = fq.fit_many(LAG, pd.Series(runs(2), index=["x", "y"]), **asked)
    assert named["name"].tolist() == ["x", "y"]
    assert fq.fit_many(LAG, pd.Series(runs(2)), **asked)["name"].tolist()[0] == "record 0"
    begun = fq.fit_many(LAG, runs(2), start=pd.Series({"a": 30.0}), **asked)
    assert (begun["error"] == "").all()


def test_a_table_beside_its_logs_is_no_log(tmp_path):
    for i in (1, 2):
        fq.write(runs(1)[0], tmp_path / f"run{i}.parquet")
    out = tmp_path / "estimates.parquet"
    for _ in range(2):
        table = fq.fit_many(LAG, sorted(tmp_path.glob("*.parquet")), out, verdicts=False)
        assert [Path(name).stem for name in table["name"]] == ["run1", "run2"]


def test_what_is_refused(tmp_path):
    with pytest.raises(ValueError, match="records"):
        fq.fit_many(LAG, [])
    with pytest.raises(ValueError, match=r"records\[1\]"):
        fq.fit_many(LAG, [runs(1)[0], 3])
    with pytest.raises(ValueError, match="option='bnad'"):
        fq.fit_many(LAG, runs(1), bnad=(1, 2))
    with pytest.raises(ValueError, match=r"\.parquet"):
        fq.fit_many(LAG, runs(1), tmp_path / "t.csv")
    (tmp_path / "folder.parquet").mkdir()
    with pytest.raises(ValueError, match="is a folder"):
        fq.fit_many(LAG, runs(1), tmp_path / "folder.parquet")
    assert not list(tmp_path.glob(".*"))
    with pytest.raises(ValueError, match="not a model"):
        fq.fit_many("lag", runs(1))
    for name, value in {
        "hold": "x", "band": (10, 1), "weights": "loud", "n_starts": 0, "error": "sum",
        "start": {"c": 1.0}, "seed": "a", "initial_state": "w", "reference": "w",
        "separate": "c", "offset": "w", "domain": "z", "loss": "l1",
    }.items():  # fmt: skip
        # the records are not looked at, so that their rows cannot say it one by one
        with pytest.raises(ValueError, match=f"^{name}"):
            fq.fit_many(LAG, ["no such file.csv"], tmp_path / "t.parquet", **{name: value})
    for name, value in {"hold": "estimate", "start": {"a": 1.0}, "separate": "a"}.items():
        with pytest.raises(ValueError, match=rf"^{name}.*black box"):
            fq.fit_many(fq.OutputError(1), ["no such file.csv"], **{name: value})
    (tmp_path / "t.parquet").write_text("no table")
    with pytest.raises(ValueError, match=r"t\.parquet"):
        fq.fit_many(LAG, runs(1), tmp_path / "t.parquet")


def fleet_of(seed, rows=60):
    rng = np.random.default_rng(seed)
    std = 0.5 + rng.random(rows)
    value = 100 + std * rng.standard_normal(rows) + 0.5 * rng.standard_normal(rows)
    return pd.DataFrame({"k": value, "k_std": std})


def test_the_picture(tmp_path):
    table = fleet_of(1)
    table.loc[7, "k"] = 130.0
    table.loc[9, "k"] = np.nan
    ax = fq.plot_fleet(table, parameter="k")
    labels = [t.get_text() for t in ax.get_legend().get_texts()]
    assert any("changed (1 of 59" in label for label in labels)
    assert "1 failed" in ax.get_title()
    with pytest.raises(ValueError, match="parameter='q'"):
        fq.plot_fleet(table, parameter="q")


def test_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for i, record in enumerate(runs(3)):
        fq.write(record, f"run{i}.csv")
    Path("run9.csv").write_text("time,u,y\n")
    arguments = ["fit-many", "run*.csv", "--model", "first-order", "--out", "t.parquet"]
    with pytest.raises(SystemExit) as end:
        commands.main([*arguments, "--jobs", "1"])
    assert end.value.code == 0
    said = capsys.readouterr().out
    assert "4 files, 1 failed" in said
    assert "trust: 3" in said
    assert pd.read_parquet("t.parquet")["a"].notna().sum() == 3
    with pytest.raises(SystemExit) as end:
        commands.main(["fit-many", "nothing*.csv", *arguments[2:]])
    assert end.value.code == 2
    # the table may lie among the logs
    for i, record in enumerate(runs(2)):
        fq.write(record, f"log{i}.parquet")
    again = ["fit-many", "*.parquet", "--model", "first-order", "--out", "est.parquet"]
    Path("t.parquet").unlink()
    for _ in range(2):
        with pytest.raises(SystemExit) as end:
            commands.main([*again, "--jobs", "1", "--no-verdicts"])
        assert end.value.code == 0
    assert len(pd.read_parquet("est.parquet")) == 2


def test_files_of_responses_are_rows_like_others(tmp_path):
    plant = fq.first_order()
    record = fq.simulate(plant, fq.white_noise(2000), 1e-3).with_noise(0.01)
    frf = fq.h1(record, 200)
    frf.to_frame().to_csv(tmp_path / "frf.csv", index=False)
    fq.write(record, tmp_path / "log.csv")
    table = fq.fit_many(plant, [tmp_path / "frf.csv", tmp_path / "log.csv"]).set_index("name")
    assert (table["error"] == "").all(), table["error"].tolist()
    one = fq.fit(plant, fq.read_response(tmp_path / "frf.csv"))
    assert table["a"].iloc[0] == pytest.approx(one["a"], rel=1e-9)
    told = fq.fit_many(plant, [tmp_path / "frf.csv"], reading={"resample": True})["error"][0]
    assert "holds a response; resample" in told
