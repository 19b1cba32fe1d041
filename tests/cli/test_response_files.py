"""Commands on files of responses, and on logs that stand where a table is wanted."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from tests.cli.test_less_usual import folder, run  # noqa: F401

OMEGA = np.linspace(1, 200, 150)
LAG = 30.0 / (25.0 + 1j * OMEGA)
MODEL = ["--model", "mine.py:plant", "--n-starts", "1"]


@pytest.fixture
def response(folder):  # noqa: F811
    """A lag of 25 rad/s at frequencies in rad/s, which the file does not say."""
    columns = {"frequency": OMEGA, "real": LAG.real, "imag": LAG.imag}
    pd.DataFrame(columns).to_csv("frf.csv", index=False)
    return Path("frf.csv")


def found(*options):
    assert run("fit", "frf.csv", *MODEL, "--out", "est.json", "--force", *options) == 0
    est = json.loads(Path("est.json").read_text())
    return dict(zip(est["names"], est["values"], strict=True))


def test_units_of_a_response_are_taken(response, capsys):
    assert found("--units", "frequency=rad/s")["a"] == pytest.approx(25, rel=1e-6)
    assert found()["a"] == pytest.approx(25 * 2 * np.pi, rel=1e-6)


def test_a_sample_time_of_a_response_is_taken(response, capsys):
    assert run("show", "frf.csv", "--dt", "0.01") == 0
    assert "dt=0.01 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--time", "frequency"], "--time is for records"),
        (["--reference", "r"], "--reference is for records"),
        (["--resample"], "--resample is for records"),
        (["--input", "a", "b"], "--input a b"),
        (["--input", "torque"], "input='torque' is not one of u"),
        (["--units", "omega=rad/s"], "units='omega'"),
    ],
)
def test_what_means_records_is_refused_beside_a_response(response, options, words, capsys):
    assert run("fit", "frf.csv", *MODEL, *options) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("command", [["show"], ["fit", *MODEL]])
def test_a_picture_of_several_channels(response, command, capsys):
    two = fq.FrequencyResponse(OMEGA / (2 * np.pi), np.stack([LAG, 2 * LAG])[:, None])
    two.to_frame().to_csv("two.csv", index=False)
    if command[0] == "fit":
        command = ["fit", "--model", "two.py:plant", "--n-starts", "1"]
        Path("two.py").write_text(
            "import freqid as fq\n\n\ndef two(a, b):\n"
            "    return [[-a]], [[b]], [[1.0], [2.0]], [[0.0], [0.0]]\n\n\n"
            'plant = fq.GreyBox(two, [fq.Parameter("a", 20.0), fq.Parameter("b", 30.0)])\n'
        )
    assert run(*command, "two.csv", "--plot", "two.png") == 0
    assert Path("two.png").stat().st_size > 1000


@pytest.mark.parametrize("given", [["*.parquet"], ["one.parquet", "two.parquet"]])
@pytest.mark.parametrize("force", [[], ["--force"]])
def test_a_log_is_never_the_table(folder, given, force, capsys):  # noqa: F811
    record = fq.read("log.csv")
    for name in ("one", "two"):
        fq.write(record, f"{name}.parquet")
    before = Path("two.parquet").read_bytes()
    assert run("fit-many", *given, *MODEL, "--out", "two.parquet", *force) == 2
    assert "is the file that is read" in capsys.readouterr().err
    assert Path("two.parquet").read_bytes() == before


def test_validating_on_the_same_file_says_so(response, capsys):
    assert run("fit", "frf.csv", *MODEL, "--validate", "frf.csv") == 0
    assert "which was fitted, too" in capsys.readouterr().out
