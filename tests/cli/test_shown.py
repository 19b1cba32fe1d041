"""What show and warnings put on the screen."""

import numpy as np
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
