"""Progress of long work, as a notebook shows it."""

import importlib.util
import warnings

import pytest

import freqid as fq
from freqid.data import progress


@pytest.mark.parametrize("wanted", [None, True])
def test_a_notebook_without_ipywidgets_is_not_warned_of_it(wanted, monkeypatch, capsys):
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setattr(
        progress, "find_spec",
        lambda name: None if name == "ipywidgets" else importlib.util.find_spec(name),
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with progress.Bar(wanted, 10, 0, "rows") as advance:
            for _ in range(10):
                advance(1)
    said = capsys.readouterr().err.splitlines()
    assert said == ([f"rows: {n} of 10" for n in range(1, 11)] if wanted else [])


def test_long_work_tells_how_far_it_is(capsys):
    plant = fq.first_order()
    clean = fq.simulate(plant, fq.chirp(2, 40, 2, 1e-2), 1e-2)
    records = [clean.with_noise(0.01, seed=i) for i in range(4)]
    est = fq.fit(plant, records)
    quiet = est.intervals("profile")
    assert capsys.readouterr().err == ""
    asked = est.intervals("profile", progress=True)
    assert (asked == quiet).all(axis=None)
    assert capsys.readouterr().err.splitlines()[-1] == "ends of profiles: 4 of 4"
    for work, said in (
        (lambda: fq.bootstrap(plant, records, 20, progress=True), "resamples: 20 of 20"),
        (lambda: fq.cross_validate(plant, records, progress=True), "repeats held out: 4 of 4"),
        (lambda: fq.select_order(records[0], [1, 2], progress=True), "orders: 2 of 2"),
    ):
        work()
        assert capsys.readouterr().err.splitlines()[-1] == said
    with pytest.raises(ValueError, match="progress"):
        est.intervals("profile", progress="yes")
