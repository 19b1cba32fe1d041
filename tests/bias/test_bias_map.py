"""Maps of bias: against single fits, resumed, on a cluster that loses a worker, and drawn."""

import importlib
import os
import signal
import threading

import numpy as np
import pandas as pd
import pytest

import freqid as fq

T1 = 0.5e-3
TRUE = fq.ZeroOrderHold(T1)
# the function goes by the name of its module
module = importlib.import_module("freqid.bias.maps")


def chirps(count=6, low=10):
    return {f"{low}-{u:g}": fq.ChirpSpectrum(low, u) for u in np.linspace(40, 90, count)}


@pytest.fixture(scope="module")
def table(plant):
    return fq.bias_map(plant, chirps(), [2, 5, 10], ["zoh", "foh", None], base_dt=T1)


@pytest.mark.study
def test_rows_equal_single_fits(plant, table):
    assert list(table.columns) == [
        "spectrum", "factor", "hold", "parameter", "true", "estimate", "relative_bias", "cost",
        "converged", "message",
    ]  # fmt: skip
    assert len(table) == 6 * 3 * 3 * 5
    assert table["converged"].all()
    spectra = chirps()
    for (name, factor, hold), part in list(table.groupby(["spectrum", "factor", "hold"]))[::4]:
        est = fq.asymptotic_fit(
            plant, spectra[name], factor * T1, None if hold == "remembered" else hold, TRUE
        )
        values = part.set_index("parameter")["estimate"][list(est.names)]
        assert np.allclose(values, est.values, rtol=1e-6)


def test_the_remembered_hold_stays_at_zero(table):
    remembered = table[table["hold"] == "remembered"]
    assert remembered["relative_bias"].abs().max() < 1e-6


def test_plants_of_several_kinds_and_other_holds():
    plants = {"axis": fq.two_mass(), "stiff": fq.two_mass(k=4e5), "lag": fq.first_order()}
    spectra = {"noise": fq.FilteredSpectrum(([0.1], [1, -0.9])), "lines": fq.MultisineSpectrum(
        (5, 90), 1.0)}  # fmt: skip
    holds = ["bl", fq.FirstOrderHold(2e-3), "zoh"]
    table = fq.bias_map(plants, spectra, [4], holds, true_hold=fq.FirstOrderHold(T1))
    assert next(iter(table.columns)) == "plant"
    assert table["converged"].all()
    row = table.query("plant == 'stiff' and spectrum == 'lines' and hold == 'bl'")
    est = fq.asymptotic_fit(plants["stiff"], spectra["lines"], 4 * T1, "bl", fq.FirstOrderHold(T1))
    assert np.allclose(row["estimate"], est.values, rtol=1e-6)


def test_a_row_that_fails_leaves_the_rest(plant):
    spectra = {**chirps(2), "above": fq.ChirpSpectrum(10, 1500), "one": fq.LineSpectrum([20], [1])}
    table = fq.bias_map(plant, spectra, [10], ["zoh"], base_dt=T1)
    by = table.groupby("spectrum", sort=False)[["converged", "message"]].first()
    assert by["converged"].tolist() == [True, True, False, False]
    assert "Nyquist" in by.loc["above", "message"]
    assert "free parameters" in by.loc["one", "message"]
    assert table.loc[~table["converged"], "estimate"].isna().all()
    assert "not physical: d" in by.iloc[0]["message"]


def test_progress_in_a_log_file_is_a_line_a_tenth(plant, capsys):
    fq.bias_map(plant, chirps(20), [10], ["zoh"], base_dt=T1, chunk=1, progress=True)
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "bias map: 20 of 20"
    assert len(lines) == 10
    fq.bias_map(plant, chirps(1), [10], ["zoh"], base_dt=T1)
    assert capsys.readouterr().err == ""


def test_bounds_hold(plant):
    bounded = plant.with_bounds(d=(0, 100))
    table = fq.bias_map(bounded, chirps(1), [10], ["zoh"], base_dt=T1)
    assert table.set_index("parameter").loc["d", "estimate"] >= 0


def test_an_interrupted_map_goes_on_where_it_was(plant, tmp_path, monkeypatch, table):
    path = tmp_path / "map.parquet"
    ask = {"base_dt": T1, "path": path, "chunk": 6}
    real, calls = module.answer_chunk, []

    def failing(*arguments):
        calls.append(1)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(module, "answer_chunk", failing)
    with pytest.raises(KeyboardInterrupt):
        fq.bias_map(plant, chirps(), [2, 5, 10], ["zoh", "foh", None], **ask)
    assert not path.exists()
    assert len(list(tmp_path.rglob("0*.parquet"))) == 4
    resumed = fq.bias_map(plant, chirps(), [2, 5, 10], ["zoh", "foh", None], **ask)
    assert len(calls) == 5 + 5
    pd.testing.assert_frame_equal(resumed, table, rtol=1e-7, atol=1e-20)
    assert list(tmp_path.iterdir()) == [path]
    again = fq.bias_map(plant, chirps(), [2, 5, 10], ["zoh", "foh", None], **ask)
    assert len(calls) == 10
    pd.testing.assert_frame_equal(again, resumed)
    with pytest.raises(ValueError, match="another path"):
        fq.bias_map(plant, chirps(), [2, 5], ["zoh", "foh", None], **ask)
    for other in ({"prefilter": ([0.1], [1, -0.9])}, {"band": (10, 30)}):
        with pytest.raises(ValueError, match="another path"):
            fq.bias_map(plant, chirps(), [2, 5, 10], ["zoh", "foh", None], **ask, **other)
    with pytest.raises(ValueError, match="another path"):
        fq.bias_map(plant.fix("fm"), chirps(), [2, 5, 10], ["zoh", "foh", None], **ask)


@pytest.mark.study
def test_a_cluster_that_loses_a_worker_gives_the_same_table(plant, two_workers):
    spectra = chirps(60)
    ask = {"base_dt": T1, "chunk": 4}
    alone = fq.bias_map(plant, spectra, [5, 10], ["zoh", "foh"], **ask)
    with two_workers() as client:
        before = set(client.run(os.getpid).values())
        assert len(before) == 2
        victim = min(before)
        threading.Timer(0.7, os.kill, (victim, signal.SIGKILL)).start()
        together = fq.bias_map(plant, spectra, [5, 10], ["zoh", "foh"], **ask)
        client.wait_for_workers(2, timeout=30)
        assert victim not in set(client.run(os.getpid).values())
    pd.testing.assert_frame_equal(together, alone, rtol=1e-7, atol=1e-20)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"factors": [2.5]}, "whole number"),
        ({"factors": []}, "at least one"),
        ({"spectra": {}}, "spectra is empty"),
        ({"spectra": [fq.WhiteSpectrum()]}, "mapping"),
        ({"holds": ["zho"]}, "not a hold"),
        ({"holds": ["estimate"]}, "estimate"),
        ({"base_dt": None}, "base_dt is missing"),
        ({"plant": {"a": 3}}, "GreyBox"),
        ({"path": "map.csv"}, "parquet"),
    ],
)
def test_bad_input(plant, changes, match):
    usual = {"plant": plant, "spectra": chirps(1), "factors": [2], "holds": ["zoh"], "base_dt": T1}
    with pytest.raises(ValueError, match=match):
        fq.bias_map(**{**usual, **changes})


def test_pictures_say_what_the_table_says(table, plant):
    axes = fq.plot_bias_map(table, "d", mark=["10-80"])
    assert [a.get_title() for a in axes] == ["ZOH", "FOH", "remembered hold"]
    cells = [t.get_text() for t in axes[0].texts]
    part = table.query("parameter == 'd' and hold == 'zoh' and factor == 10")
    assert f"{100 * part['relative_bias'].iloc[0]:+.0f}" in cells
    with pytest.raises(ValueError, match="not one of"):
        fq.plot_bias_map(table, "mass")
    curves = fq.plot_bias_curves(table, 10, ["Jm", "d"])
    x, y = curves[1].lines[1].get_data()
    assert np.allclose(x, np.linspace(40, 90, 6))
    assert np.allclose(y * 10, part["estimate"])
    amplitude, _, plane = fq.plot_bias(plant, fq.ChirpSpectrum(10, 80), 5e-3, "zoh", TRUE)
    # its lines had names of their own, "measured 1" and "response"
    assert plane.get_legend() is None
    assert [x.get_label() for x in plane.lines] == [x.get_label() for x in amplitude.lines]
    assert "d = -231.4" in amplitude.figure.get_suptitle()
    assert len(plane.lines) == 3


def test_a_row_that_cannot_be_refined_is_fitted_alone(monkeypatch):
    """Nodes that are too coarse for its end are no reason to call a row of the batch settled."""
    from freqid.bias import map_rows

    alone, made = [], map_rows._problem

    def problem(model, row, shared, at=None):
        if at is not None:
            raise fq.checks.InputError("too dear")
        return made(model, row, shared)

    fit_alone = map_rows._alone
    monkeypatch.setattr(map_rows, "_problem", problem)
    monkeypatch.setattr(map_rows, "_alone", lambda *a: alone.append(1) or fit_alone(*a))
    monkeypatch.setattr(
        map_rows.Batch, "unresolved", lambda self, x, tolerance: np.ones(len(x), bool)
    )
    table = fq.bias_map(
        fq.first_order(), {"2-40": fq.ChirpSpectrum(2, 40)}, [2, 3], ["zoh"], 5e-3, n_jobs=1
    )
    assert len(alone) == 2
    assert table["converged"].all()


def test_a_map_ends_when_it_is_told_to(monkeypatch):
    """Found: each Ctrl-C cost one row, and the map went on and said that it was done."""
    from freqid.fitting.cost.objective import Objective

    whole, calls = Objective._compute, []

    def interrupted(self, x):
        calls.append(x)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return whole(self, x)

    # a bound, so that each row is fitted by itself
    bounded = fq.first_order().with_bounds(a=(0.0, 500.0))
    monkeypatch.setattr(Objective, "_compute", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fq.bias_map(bounded, {"white": fq.WhiteSpectrum()}, [2, 5], ("zoh",), 0.01)
    assert len(calls) < 8
