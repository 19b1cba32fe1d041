"""Commands as they are used less often: options that do not go together, own plants, no plot."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.cli import commands
from freqid.cli.plants import from_file, in_python

PLANT = """
import freqid as fq

def lag(a, b):
    return [[-a]], [[b]], [[1.0]], None

plant = fq.GreyBox(lag, [fq.Parameter("a", 20.0), fq.Parameter("b", 30.0)])
box = fq.OutputError(2)

def made():
    return plant
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A record of a lag of 25 rad/s and a plant of one's own."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(PLANT)
    scope = {}
    exec(PLANT, scope)
    truth = scope["plant"].with_values(a=25.0)
    record = fq.simulate(truth, fq.white_noise(2000, seed=1), 0.005).with_noise(0.001, seed=2)
    fq.write(record, "log.csv")
    return tmp_path


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        commands.main([str(a) for a in arguments])
    return end.value.code


def test_keeping_the_input_is_of_decimation(folder, capsys):
    assert run("fit", "log.csv", "--model", "mine.py:plant", "--keep-input") == 2
    assert "--keep-input says what --decimate keeps" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--reference", "r"], "--reference needs --method h1"),
        (["--method", "lpm", "--segment", "200"], "--segment needs --method h1"),
    ],
)
def test_options_of_frf_that_do_not_go_together(folder, options, words, capsys):
    table = fq.read("log.csv").to_frame().assign(r=1.0)
    table.to_csv("loop.csv")
    told = ["--input", "u", "--output", "y"]
    assert run("frf", "loop.csv", *told, *options, "--out", "frf.csv") == 2
    assert words in capsys.readouterr().err
    assert not Path("frf.csv").exists()


def test_frf_to_a_table_alone(folder, capsys):
    assert run("frf", "log.csv", "--method", "h1", "--segment", "200", "--out", "frf.csv") == 0
    frf = fq.read_response("frf.csv")
    assert len(frf.frequency) == 100
    np.testing.assert_allclose(frf.response, fq.h1(fq.read("log.csv"), 200).response)


def test_what_is_fixed_and_begun_from_is_fixed_there(folder, capsys):
    assert run("fit", "log.csv", "--model", "mine.py:plant", "--fix", "b", "--start", "b=30",
               "--out", "est.json") == 0  # fmt: skip
    scope = {}
    exec(PLANT, scope)
    est = fq.load("est.json", model=scope["plant"].fix("b"))
    assert est["a"] == pytest.approx(25, rel=0.01)
    assert run("fit", "log.csv", "--model", "mine.py:plant", "--fix", "b", "--start", "b=33",
               "--out", "other.json") in (0, 1)  # fmt: skip
    other = fq.load("other.json", model=scope["plant"].with_values(b=33.0).fix("b"))
    assert other["b"] == 33.0
    assert other["a"] != pytest.approx(est["a"], rel=0.01)


def test_fleets_begin_where_they_are_told_to(folder, capsys):
    code = run("fit-many", "log.csv", "--model", "mine.py:plant", "--start", "a=24", "--start",
               "b=29", "--out", "table.parquet", "--no-verdicts")  # fmt: skip
    assert code == 0
    assert pd.read_parquet("table.parquet")["a"].iloc[0] == pytest.approx(25, rel=0.01)
    # a pattern that takes in nothing but the table itself
    assert (
        run("fit-many", "tab*.parquet", "--model", "mine.py:plant", "--out", "table.parquet") == 2
    )
    assert "matches no file but" in capsys.readouterr().err


def test_a_table_of_other_fits_is_replaced_where_that_is_said(folder, capsys):
    words = ["fit-many", "log.csv", "--model", "mine.py:plant", "--out", "table.parquet"]
    assert run(*words, "--no-verdicts") == 0
    assert run(*words) == 2
    said = capsys.readouterr().err
    assert "other fits" in said
    assert "or --force to replace it" in said
    assert "verdict" not in pd.read_parquet("table.parquet")
    assert run(*words, "--force") == 0
    assert pd.read_parquet("table.parquet")["verdict"].iloc[0] == "trust"
    assert [p.name for p in folder.glob("*table*")] == ["table.parquet"]


def test_files_of_a_fleet_that_are_not_to_be_used_are_named(folder, capsys):
    record = fq.read("log.csv")
    turned = fq.Record(record.u, -record.y, record.dt)
    fq.write(turned, "turned.csv")
    assert run("fit-many", "*.csv", "--model", "mine.py:plant", "--out", "table.parquet") == 0
    table = pd.read_parquet("table.parquet").set_index("name")
    assert table.loc["log.csv", "verdict"] == "trust"
    bad = list(table.index[table["verdict"] == "do not use"])
    told = capsys.readouterr().out.splitlines()
    where = told.index(f"  do not use: {len(bad)}")
    assert (
        [line.strip() for line in told[where + 1 : where + 1 + len(bad)]] == bad == ["turned.csv"]
    )


def test_the_explorer_takes_plants_with_parameters_alone(folder, capsys):
    assert run("explore", "log.csv", "--model", "mine.py:box") == 2
    assert "is no grey box; the explorer moves parameters" in capsys.readouterr().err


def test_how_python_comes_by_a_model(folder):
    assert in_python("two-mass") == ("", "fq.two_mass()")
    for name in ("plant", "made"):
        imported, called = in_python(f"mine.py:{name}")
        scope = {}
        exec(f"{imported}\nfound = {called}", scope)
        assert scope["found"]["a"] == 20.0


def test_a_model_that_is_no_python(folder):
    Path("mine.txt").write_text(PLANT)
    with pytest.raises(ValueError, match=r"mine\.txt is no Python file"):
        from_file(Path("mine.txt"), "plant")


def test_bias_for_one_parameter_to_a_table(folder, capsys):
    code = run("bias", "--model", "first-order", "--chirp", "5", "20", "--factor", "2", "--base-dt",
               "0.005", "--parameter", "a", "--out", "bias.csv", "--plot", "bias.png")  # fmt: skip
    assert code == 0, capsys.readouterr().err
    assert set(pd.read_csv("bias.csv")["parameter"]) == {"a", "b"}
    assert Path("bias.png").stat().st_size > 1000
    code = run("bias", "--model", "first-order", "--chirp", "5", "20", "--factor", "2",
               "--parameter", "zz", "--out", "none.csv", "--plot", "none.png")  # fmt: skip
    assert code == 2
    assert "--parameter='zz' is not one of '" in capsys.readouterr().err
    assert not Path("none.csv").exists()


def test_what_is_to_be_done_is_said_as_it_is_typed(folder, capsys):
    table = fq.read("log.csv").to_frame().reset_index()
    table.assign(v=table["u"]).rename(columns={"u": "p"}).to_csv("three.csv", index=False)
    assert run("fit", "three.csv", "--model", "mine.py:plant") == 2
    assert "no --input, no --output: name them; the columns are" in capsys.readouterr().err
    uneven = table.assign(time=table["time"] + 2e-3 * np.sin(np.arange(len(table))))
    uneven.to_csv("uneven.csv", index=False)
    assert run("frf", "uneven.csv") == 2
    assert "; --resample puts them on a regular grid" in capsys.readouterr().err
    table.assign(time=np.arange(len(table))).to_csv("steps.csv", index=False)
    assert run("show", "steps.csv") == 0
    assert "give --units time=ms where they are milliseconds" in capsys.readouterr().out


def test_a_start_inside_of_its_bounds_is_one(folder, capsys):
    """The value of the built-in model, which nobody typed, lay outside of them."""
    code = run("fit", "log.csv", "--model", "first-order", "--start", "a=15", "--bounds", "a", "1",
               "60")  # fmt: skip
    assert code == 0, capsys.readouterr().err
    assert run("fit", "log.csv", "--model", "first-order", "--bounds", "a", "1", "60") == 2
    assert "a=100" in capsys.readouterr().err


def test_what_failed_in_a_fleet_is_told_by_file(folder, capsys):
    still = fq.read("log.csv")
    fq.write(fq.Record(0 * still.u, still.y, still.dt), "still.csv")
    words = ["--model", "mine.py:plant", "--out", "table.parquet", "--no-verdicts"]
    assert run("fit-many", "*.csv", *words) == 0
    assert "still.csv: " in capsys.readouterr().out
    (folder / "logs").mkdir()
    assert run("fit-many", "logs", *words) == 2
    assert "logs is a folder; give its files, as in 'logs/**/*.csv'" in capsys.readouterr().err


def test_files_that_cannot_be_written_are_named(folder, capsys):
    assert run("fit", "log.csv", "--model", "mine.py:plant", "--out", "/proc/est.json") == 2
    said = capsys.readouterr().err
    assert "/proc/est.json" in said
    assert "Errno" not in said
