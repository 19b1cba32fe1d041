"""A first day on the command line: one's own file, one's own plant, a report."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.cli import commands

PLANT = """
import freqid as fq

def matrices(J, k, d):
    return [[0, 1], [-k / J, -d / J]], [[0], [1 / J]], [[1, 0]], None

plant = fq.GreyBox(matrices, [fq.Parameter("J", 0.12), fq.Parameter("k", 90.0),
                              fq.Parameter("d", 0.3)])

def made():
    return plant.with_values(J=0.11)
number = 3
"""


@pytest.fixture
def day(tmp_path, monkeypatch):
    """A folder with a semicolon file and a plant."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_plant.py").write_text(PLANT)
    scope = {}
    exec(PLANT, scope)
    truth = scope["plant"].with_values(J=0.1, k=100.0, d=0.2)
    for seed, name in enumerate(("train", "other")):
        record = fq.simulate(truth, fq.white_noise(1500, seed=seed), 0.01).with_noise(
            1e-4, seed=seed
        )
        rows = zip(1e3 * record.time, record.u, record.y, strict=True)
        lines = [";".join(f"{x:.9f}" for x in row).replace(".", ",") for row in rows]
        text = "Zeit [ms];torque [N m];angle [rad]\n" + "\n".join(lines) + "\n"
        (tmp_path / f"{name}.csv").write_text(text)
    return tmp_path


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        commands.main([str(a) for a in arguments])
    return end.value.code


def test_from_a_file_and_a_plant_to_a_report(day, capsys):
    code = run(
        "fit", "train.csv", "--model", "my_plant.py:plant", "--start", "k=80", "--validate",
        "other.csv", "--out", "est.json", "--report", "est.html",
    )  # fmt: skip
    said = capsys.readouterr().out
    assert code == 0
    assert "verdict: trust" in said
    assert "other.csv, which was not fitted: 9" in said
    assert "in ms" in said
    scope = {}
    exec(PLANT, scope)
    est = fq.load("est.json", model=scope["plant"])
    assert est["k"] == pytest.approx(100, rel=0.01)
    kept = json.loads(Path("est.json").read_text())
    assert kept["parameters"]["k"]["value"] == est["k"]
    assert kept["freqid"] == fq.__version__
    assert Path("est.html").stat().st_size > 1000


def test_a_plant_of_ones_own_is_asked_for_as_it_is_typed(day, capsys):
    words = ["train.csv", "--model", "my_plant.py:plant", "--n-starts", "1"]
    assert run("fit", *words, "--out", "est.json") == 0
    assert run("show", "est.json") == 2
    assert "--model your_file.py:plant" in capsys.readouterr().err
    assert run("show", "est.json", "--model", "my_plant.py:plant") == 0


def test_the_bias_of_a_plant_with_a_delay(day, capsys):
    """Straight lines, which a delay refuses, were asked for by default."""
    late = (
        PLANT
        + """
plant = fq.GreyBox(matrices, [*plant.parameters, fq.Parameter("T", 0.01)], input_delay="T")
"""
    )
    (day / "late.py").write_text(late)
    words = ["--model", "late.py:plant", "--chirp", "1", "20", "--factor", "2"]
    assert run("bias", *words, "--base-dt", "0.005") == 0
    assert "nan" not in capsys.readouterr().out


def test_options_of_the_plant(day, capsys):
    assert run("fit", "train.csv", "--model", "my_plant.py:made", "--fix", "d", "--bounds", "k",
               "50", "95", "--prior", "J", "0.1", "0.01", "--n-starts", "2") == 0  # fmt: skip
    said = capsys.readouterr().out
    assert "edge of a bound" in said
    assert "\n        d " not in said
    assert (
        run("fit", "train.csv", "--model", "transfer-function", "--zeros", "0", "--poles", "2") == 0
    )
    assert run("fit", "train.csv", "--model", "my_plant.py:plant", "--conditions", "J=0.1") == 0


def test_a_part_of_a_record(day, capsys):
    plant = ("--model", "my_plant.py:plant")
    assert run("fit", "train.csv", *plant, "--between", "2", "8", "--out", "part.json") == 0
    record = fq.read("train.csv").slice(2, 8)
    scope = {}
    exec(PLANT, scope)
    kept = json.loads(Path("part.json").read_text())["parameters"]
    assert kept["k"]["value"] == pytest.approx(fq.fit(scope["plant"], record)["k"], rel=1e-9)
    capsys.readouterr()
    assert run("show", "train.csv", "--between", "2", "inf") == 0
    assert "1300 samples" in capsys.readouterr().out
    for wrong in (("8", "2"), ("-1", "2"), ("80", "90")):
        assert run("fit", "train.csv", *plant, "--between", *wrong) == 2
        said = capsys.readouterr().err
        assert "--between" in said or "the record runs from 0 to 15 s" in said


def test_a_new_model_is_a_plant(day, capsys):
    assert run("new-model", "axis.py") == 0
    assert run("fit", "train.csv", "--model", "axis.py:plant") == 0
    assert run("new-model", "axis.py") == 2
    assert run("new-model", "axis.py", "--force") == 0
    assert run("new-model", "axis.txt") == 2


def test_show(day, capsys):
    assert run("show", "train.csv", "--plot", "train.png") == 0
    said = capsys.readouterr().out
    assert "torque" in said
    assert "1500 samples at 0.01 s" in said
    assert Path("train.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "my_plan.py:plant"], "does not exist"),
        (["--model", "my_plant.py:plan"], "did you mean 'plant'"),
        (["--model", "my_plant.py:number"], "expected a GreyBox"),
        (["--model", "two-mas"], "did you mean 'two-mass'"),
        (["--model", "my_plant.py:plant", "--start", "k"], "is not NAME=VALUE"),
        (["--model", "my_plant.py:plant", "--start", "q=3"], "start='q'"),
        (["--model", "my_plant.py:plant", "--fix", "stiffness"], "'stiffness'"),
        (["--model", "output-error", "--fix", "k"], "need a plant"),
        (["--model", "two-mass", "--out", "train.csv"], "never overwritten"),
        (["--model", "two-mass", "--out", "train.csv", "--force"], "never overwritten"),
        (["--model", "two-mass", "--out", "other.csv"], "--force"),
        (["--model", "two-mass", "--out", "est.txt"], ".json"),
        (["--model", "two-mass", "--report", "."], "is a folder"),
    ],
)
def test_refused(day, arguments, words, capsys):
    before = {p.name: p.read_bytes() for p in day.iterdir() if p.is_file()}
    assert run("fit", "train.csv", *arguments) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    after = {p.name: p.read_bytes() for p in day.iterdir() if p.is_file()}
    assert after == before


def test_a_measurement_is_never_overwritten(day, capsys):
    for extra in ([], ["--force"]):
        assert run("frf", "train.csv", "--out", "train.csv", *extra) == 2
        assert run("frf", "train.csv", "--plot", "./train.csv", *extra) == 2
    assert "never overwritten" in capsys.readouterr().err
    assert run("frf", "train.csv", "--out", "frf.csv") == 0
    assert run("frf", "train.csv", "--out", "frf.csv") == 2
    assert run("frf", "train.csv", "--out", "frf.csv", "--force") == 0
    assert fq.read_response("frf.csv").response.shape == (1, 1, 750)


def test_a_file_that_fails_says_where(day, capsys):
    Path("bad.py").write_text("import nothing_of_this_name")
    assert run("fit", "train.csv", "--model", "bad.py:plant") == 2
    assert "bad.py: ModuleNotFoundError" in capsys.readouterr().err
    assert np.isfinite(fq.read("train.csv").dt)


def test_what_warnings_advise_can_be_done(tmp_path, monkeypatch, capsys):
    """Time in ms by name of unit, an offset, spikes, a reference and a direct term."""
    monkeypatch.chdir(tmp_path)
    lag = fq.first_order(b=50.0, a=20.0)
    rng = np.random.default_rng(4)
    u = rng.standard_normal(800)
    y = fq.simulate(lag, u, 0.01).y
    y = y + 0.5 + 0.02 * y.std() * rng.standard_normal(800)
    y[[100, 500]] += 10 * y.std()
    table = pd.DataFrame({"t": 10.0 * np.arange(800), "u": u, "y": y, "wanted": u})
    table.to_csv("log.csv", index=False)
    given = ("fit", "log.csv", "--model", "first-order", "--input", "u", "--output", "y")
    assert run(*given, "--units", "t=ms", "--offset", "--loss", "huber", "--out", "est.json") == 0
    said = capsys.readouterr().out
    assert "offset estimated: y 0." in said
    est = fq.load("est.json")
    assert est["a"] == pytest.approx(20, rel=0.05)
    assert run(*given, "--units", "t=ms", "--reference", "wanted", "--force") == 0
    assert "the reference explains 100 %" in capsys.readouterr().out
    assert run("fit", "log.csv", "--model", "output-error", "--order", "1", "--feedthrough",
               "--units", "t=ms", "--input", "u", "--output", "y") == 0  # fmt: skip
    assert run(*given, "--feedthrough") != 0
    assert "--feedthrough is output-error's" in capsys.readouterr().err
    assert run(*given, "--units", "ms") != 0
    assert "--units ms is not NAME=VALUE" in capsys.readouterr().err


def test_an_analysers_file_is_fitted(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plant = fq.first_order()
    f = np.geomspace(1, 100, 80)
    G = plant.frequency_response(2 * np.pi * f).response[0, 0]
    rows = np.column_stack([f, 20 * np.log10(abs(G)), np.degrees(np.angle(G))])
    lines = "\n".join(";".join(f"{x:.12g}" for x in row) for row in rows)
    (tmp_path / "frf.csv").write_text(f"Frequency [Hz];Magnitude [dB];Phase [deg]\n{lines}\n")
    assert run("fit", "frf.csv", "--model", "first-order", "--start", "a=30", "b=50",
               "--out", "e.json", "--plot", "e.png") == 0  # fmt: skip
    assert fq.load("e.json")["a"] == pytest.approx(100, rel=1e-6)
    assert (tmp_path / "e.png").stat().st_size > 1000
    assert run("show", "frf.csv", "--plot", "f.png") == 0
    assert "80 lines" in capsys.readouterr().out
    assert run("fit", "frf.csv", "--model", "first-order", "--decimate", "2") == 2
    assert "--decimate is for records" in capsys.readouterr().err


def test_files_are_read_as_they_are_told_to_be_by_every_command(day, capsys):
    text = (day / "train.csv").read_text().partition("\n")[2]
    (day / "bare.csv").write_text(text)
    told = ["--sep", ";", "--decimal", ",", "--columns", "ms", "torque", "angle",
            "--input", "torque", "--output", "angle", "--units", "ms=ms"]  # fmt: skip
    assert run("show", "bare.csv", *told) == 0
    said = capsys.readouterr().out
    assert "Record torque -> angle: 1500 samples at 0.01 s" in said
    assert run("frf", "bare.csv", *told, "--band", "0.5", "20", "--out", "frf.csv") == 0
    assert run("fit", "bare.csv", "--model", "my_plant.py:plant", *told) == 0
    assert run("fit", "bare.csv", "--model", "transfer-function", "--zeros", "0", "--poles", "2",
               "--delay", "0", *told) == 0  # fmt: skip
    assert run("fit", "bare.csv", "--model", "output-error", "--order", "2", "--stable", *told) == 0
    said = capsys.readouterr().out
    assert "verdict" in said
    assert run("fit", "bare.csv", "--model", "my_plant.py:plant", "--stable", *told) == 2
    assert run("fit", "bare.csv", "--model", "two-mass", "--delay", "estimate", *told) == 2
    assert run("bias", "--model", "my_plant.py:plant", "--chirp", "1", "20", "--factor", "5",
               "--base-dt", "2e-3", "--out", "bias.csv") == 0  # fmt: skip


@pytest.mark.parametrize("command", ["fit", "frf", "show", "fit-many", "bias", "explore"])
def test_help_tells_every_option_and_no_opposites(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")
    run(command, "--help")
    said = capsys.readouterr().out
    assert "--no-force" not in said
    rows = [line.strip("│ *") for line in said.splitlines() if line.startswith("│")]
    told = [row for row in rows if row.startswith("--") or " --" in row[:20]]
    assert len(told) > 5
    silent = [row for row in told if not re.search(r"\S\s{2,}[^\s[]", row)]
    assert not silent


def test_an_interrupted_command_says_so(day):
    code = [sys.executable, "-m", "freqid.cli", "fit", "train.csv", "--model", "three-mass",
            "--n-starts", "5000"]  # fmt: skip
    process = subprocess.Popen(code, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(4)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode in (1, 130)
    assert "interrupted" in out + err
    assert "Traceback" not in err
