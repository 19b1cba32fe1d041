"""Progress of long work, as a notebook shows it."""

import importlib.util
import warnings

import pytest

from freqid.fitting.many import progress


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
