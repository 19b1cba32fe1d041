"""The command line as a user meets it: a process, its screen, its exit code, its files."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

import freqid as fq


def run(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "freqid.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def chirp(tmp_path_factory, fast, slow):
    folder = tmp_path_factory.mktemp("cli")
    fq.write(fast, folder / "fast.csv")
    fq.write(slow, folder / "slow.csv")
    return folder


def test_the_package_runs_as_a_module_and_shows_notes_once(tmp_path):
    page = subprocess.run(
        [sys.executable, "-m", "freqid.cli", "--help"], capture_output=True, text=True, check=False
    )
    assert page.returncode == 0
    assert "COMMAND" in page.stdout
    log = pd.DataFrame({"time [ms]": 2.0 * np.arange(50), "u": np.ones(50), "y": np.arange(50.0)})
    log.to_csv(tmp_path / "log.csv", index=False)
    shown = run("show", tmp_path / "log.csv").stdout
    assert shown.count("note") == 1
    assert "nan" not in shown


@pytest.mark.study
def test_reproduce(tmp_path):
    result = run("reproduce", "--out", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert "-230" in result.stdout
    assert "1.3e7" in result.stdout
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert {"table2.csv", "equations.csv", "fig01.png", "fig10.pdf"} <= names
    assert len(names) == 22
    assert pd.read_csv(tmp_path / "out" / "table2.csv")["lifted"].iloc[4] == pytest.approx(10)


def test_fit_writes_json(chirp, tmp_path):
    out = tmp_path / "est.json"
    result = run(
        "fit", chirp / "fast.csv", "--model", "two-mass", "--decimate", 10, "--hold", "zoh",
        "--band", 10, 80, "--out", out,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "not physical: d=" in result.stdout
    saved = json.loads(out.read_text())
    assert saved["parameters"]["d"]["value"] < -200
    assert saved["hold_period"] == pytest.approx(5e-3)


def test_fit_remembers_or_is_told_the_hold(chirp):
    for options in ((), ("--hold", "zoh:0.0005")):
        result = run("fit", chirp / "slow.csv", "--model", "two-mass", "--band", 10, 80, *options)
        assert result.returncode == 0, result.stderr
        assert "ZeroOrderHold(period=0.0005)" in result.stdout
        assert "warning" not in result.stdout


def test_frf(chirp, tmp_path):
    result = run(
        "frf", chirp / "fast.csv", "--input", "u", "--output", "y", "--band", 10, 80,
        "--out", tmp_path / "frf.csv", "--plot", tmp_path / "frf.png",
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert len(pd.read_csv(tmp_path / "frf.csv")) == 701
    assert (tmp_path / "frf.png").stat().st_size > 5000


MISTAKES = {
    "nowhere.csv does not exist": ["fit", "nowhere.csv", "--model", "two-mass"],
    "two-mas": ["fit", "slow.csv", "--model", "two-mas"],
    "band=(10, 800)": ["fit", "slow.csv", "--model", "two-mass", "--band", "10", "800"],
    "--hold xoh is not a hold; expected zoh, foh": [
        "fit",
        "slow.csv",
        "--model",
        "two-mass",
        "--hold",
        "xoh",
    ],
    "--hold zoh:-1": ["fit", "slow.csv", "--model", "two-mass", "--hold", "zoh:-1"],
    "factor=0": ["fit", "slow.csv", "--model", "two-mass", "--decimate", "0"],
    "inputs='motor'": ["frf", "slow.csv", "--input", "motor", "--output", "y"],
    "--bnad": ["frf", "slow.csv", "--bnad", "1", "2"],
    "Unknown command": ["fitt", "slow.csv"],
    "is a file": ["demo", "--out", "slow.csv"],
    "--model": ["fit", "slow.csv"],
}


@pytest.mark.parametrize("words", MISTAKES)
def test_mistakes_are_one_line_and_exit_code_2(words, chirp):
    before = sorted(p.name for p in chirp.iterdir())
    result = run(*MISTAKES[words], cwd=chirp)
    assert result.returncode == 2
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert "Traceback" not in result.stderr
    assert sorted(p.name for p in chirp.iterdir()) == before


def test_a_fit_that_does_not_converge_is_exit_code_1(chirp, monkeypatch, capsys):
    import dataclasses

    from freqid.cli import commands as cli

    real = fq.fit
    monkeypatch.setattr(
        fq, "fit", lambda *a, **k: dataclasses.replace(real(*a, **k), converged=False)
    )
    with pytest.raises(SystemExit) as end:
        cli.main(["fit", str(chirp / "slow.csv"), "--model", "first-order"])
    assert end.value.code == 1


def test_bias_prints_the_table_and_draws_the_map(tmp_path):
    done = run("bias", "--model", "two-mass", "--chirp", "10", "80", "--factor", "5", "10",
               "--out", "bias.csv", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "-231.4" in done.stdout
    assert "not physical: d" in done.stdout
    assert (tmp_path / "bias.png").stat().st_size > 10_000
    assert len((tmp_path / "bias.csv").read_text().splitlines()) == 1 + 2 * 3 * 5


def test_files_that_are_there_are_kept_unless_forced(chirp, tmp_path):
    commands = {
        "bias.png": ["bias", "--model", "first-order", "--chirp", 10, 80, "--factor", 2],
        "chirp_slow.csv": ["demo", "--out", "."],
        "fig07.pdf": ["reproduce", "--out", "."],
        "frf.csv": ["frf", chirp / "fast.csv", "--out", "frf.csv"],
    }
    for name, words in commands.items():
        (tmp_path / name).write_text("mine")
        done = run(*words, cwd=tmp_path)
        assert done.returncode == 2
        assert "is there already" in done.stderr
        assert "--force" in done.stderr
        assert (tmp_path / name).read_text() == "mine"
    assert run(*commands["chirp_slow.csv"], "--force", cwd=tmp_path).returncode == 0
    assert (tmp_path / "chirp_slow.csv").stat().st_size > 1000


def test_bias_refuses_bad_input(tmp_path):
    for wrong in (["80", "10", "--factor", "2"], ["10", "2000", "--factor", "2"],
                  ["10", "80", "--factor", "2.5"]):  # fmt: skip
        done = run("bias", "--model", "two-mass", "--chirp", *wrong, cwd=tmp_path)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "bias.png").exists()


def test_a_record_that_contradicts_has_its_say_in_the_verdict_that_is_printed(tmp_path):
    plant = fq.first_order(b=40.0, a=40.0)
    u = fq.chirp(1, 50, 4, 2e-3)
    good = fq.simulate(plant, u, 2e-3).with_noise(0.01)
    other = fq.Record(good.u, good.y + 0.5 * good.y.std(), 2e-3)
    fq.write(good, tmp_path / "good.csv")
    fq.write(other, tmp_path / "other.csv")
    words = ["fit", tmp_path / "good.csv", "--model", "first-order"]
    assert "verdict: trust" in run(*words).stdout
    beside = run(*words, "--validate", tmp_path / "other.csv")
    assert "verdict: doubt: validation: another record" in beside.stdout
