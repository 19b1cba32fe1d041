"""What show and warnings put on the screen."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.cli import commands as cli


def command(*words):
    with pytest.raises(SystemExit) as end:
        cli.main([str(w) for w in words])
    assert end.value.code == 0


def test_an_estimate_in_a_file_is_shown_as_fit_showed_it(tmp_path, capsys):
    plant = fq.first_order(b=40.0, a=40.0)
    record = fq.simulate(plant, fq.white_noise(800), 2e-3).with_noise(0.01)
    fq.write(record, tmp_path / "run.csv")
    words = [str(tmp_path / "run.csv"), "--model", "first-order", "--start", "a=50"]
    command("fit", *words, "--out", tmp_path / "est.json")
    fitted = capsys.readouterr().out
    command("show", tmp_path / "est.json", "--plot", tmp_path / "bode.png")
    shown = capsys.readouterr().out
    assert fitted.splitlines()[1:] == shown.splitlines()[1:]
    assert "verdict: trust" in shown
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    with pytest.raises(SystemExit) as end:
        cli.main(["show", str(tmp_path / "run.csv"), "--model", "first-order"])
    assert end.value.code == 2
    assert "is no estimate" in capsys.readouterr().err


def test_warnings_are_lines_of_the_terminal(tmp_path, capsys, recwarn):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    fq.write(fq.Record(u, u + 1e-3 * rng.standard_normal(400), 1e-2), tmp_path / "run.csv")
    calls, real = [], fq.etfe

    def warned(*args, **options):
        import warnings

        warnings.warn("the record is\n odd", RuntimeWarning, stacklevel=2)
        calls.append(args)
        return real(*args, **options)

    fq.etfe, warnings_before = warned, len(recwarn)
    try:
        command("frf", tmp_path / "run.csv", "--input", "u", "--output", "y")
    finally:
        fq.etfe = real
    assert calls
    assert len(recwarn) == warnings_before
    assert capsys.readouterr().err == "freqid: warning: the record is odd\n"


def refused(capsys, *words):
    with pytest.raises(SystemExit) as end:
        cli.main([str(w) for w in words])
    assert end.value.code == 2
    return capsys.readouterr()


@pytest.fixture
def motor(tmp_path):
    """Two experiments in one table, the time of which begins anew, and where they are apart."""
    plant = fq.first_order(b=40.0, a=40.0)
    records = [fq.simulate(plant, fq.white_noise(400, seed=k), 2e-3) for k in range(2)]
    table = pd.concat([pd.DataFrame({"time": r.time, "u": r.u, "y": r.y}) for r in records])
    table.to_csv(tmp_path / "both.csv", index=False)
    return tmp_path, table


def test_experiments_one_after_another_are_told(motor, capsys):
    folder, table = motor
    command("channels", folder / "both.csv")
    said = capsys.readouterr().out
    assert "note: the time begins anew in row 400" in said
    assert [line.split()[1] for line in said.splitlines()[1:3]] == ["500", "500"]
    assert "rows 0 to 399, and from 400 on" in refused(capsys, "show", folder / "both.csv").err
    command("show", folder / "both.csv", "--between", "0", "0.7")
    assert "350 samples" in capsys.readouterr().out
    first = fq.read(folder / "both.csv", stop=0.7)
    np.testing.assert_allclose(first.y, table["y"].to_numpy()[: first.n_samples])
    for wrong in (table.iloc[:400].iloc[::-1], table.iloc[[*range(20), 5, *range(20, 300)]]):
        wrong.to_csv(folder / "wrong.csv", index=False)
        assert "does not increase in row" in refused(capsys, "show", folder / "wrong.csv").err


def test_what_is_cut_off_need_not_be_whole(motor, capsys):
    folder, table = motor
    part = table.iloc[:400].reset_index(drop=True)
    part.loc[10:14, "y"] = np.nan
    part.to_csv(folder / "blank.csv", index=False)
    words = [folder / "blank.csv", "--model", "first-order", "--between", "0.1", "inf"]
    command("fit", *words, "--out", folder / "est.json")
    assert "verdict: trust" in capsys.readouterr().out
    said = refused(capsys, "fit", *words[:-3]).err
    assert "--between START STOP cuts the file" in said
    assert "start=" not in said


def test_what_a_file_holds_is_shown_where_more_has_to_be_said(motor, capsys):
    folder, table = motor
    part = table.iloc[:400].set_axis(["time", "voltage", "speed"], axis=1)
    part.assign(current=1.0 + part["voltage"]).to_csv(folder / "motor.csv", index=False)
    said = refused(capsys, "show", folder / "motor.csv")
    assert [line.split()[0] for line in said.out.splitlines()] == [
        "channel", "voltage", "speed", "current"
    ]  # fmt: skip
    assert "--input" in said.err


def test_one_of_several_tables(motor, capsys):
    h5py = pytest.importorskip("h5py")
    folder, table = motor
    with h5py.File(folder / "runs.h5", "w") as file:
        for k, count in enumerate((400, 300)):
            for name in table:
                file[f"run{k}/{name}"] = table[name].to_numpy()[:count]
    ends = ["--group", "run1", "--input", "u", "--output", "y"]
    command("show", folder / "runs.h5", *ends)
    assert "300 samples" in capsys.readouterr().out
    command("channels", folder / "runs.h5", "--group", "run0")
    assert capsys.readouterr().out.splitlines()[1].split()[3] == "400"
    assert "run0" in refused(capsys, "channels", folder / "runs.h5").err
