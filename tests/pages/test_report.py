"""A report: small, whole, and sending nothing anywhere."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.pages.report.figures import figures


@pytest.fixture(scope="module")
def unlike():
    """Two runs of one axis that differ by two per cent, 20,000 samples each."""
    u = fq.chirp(10, 80, 20, 1e-3)
    runs = [fq.simulate(fq.two_mass(k=k), u, 1e-3).with_noise(0.5, seed=i)
            for i, k in enumerate((1.5e5, 1.53e5))]  # fmt: skip
    return fq.fit(fq.two_mass(), runs)


@pytest.mark.study
def test_of_long_records_it_stays_below_a_megabyte(unlike, tmp_path):
    unlike.report(tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text()
    assert len(text.encode()) < 1e6
    assert "src=" not in text
    assert 'plotlyServerURL: ""' in text


def test_it_has_modes_correlations_and_what_lies_between_parts(unlike, tmp_path):
    unlike.report(tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text()
    for table in ("parameters", "modes", "spread", "correlations"):
        assert f'<table id="{table}">' in text
    row = unlike.spread.loc[("experiments", "k")]
    assert f"<td>{row['percent']:.3g}</td>" in text
    assert "<td>25." in text


def test_a_long_record_keeps_its_peaks(tmp_path):
    """One sample of a million stands out, between those that a thinned curve would show."""
    from freqid.pages.report.figures import figures

    u = fq.white_noise(100_000, seed=1)
    record = fq.simulate(fq.first_order(), u, 1e-3)
    y = record.y.copy()
    y[54_321] += 50.0
    est = fq.fit(fq.first_order(), fq.Record(u, y, 1e-3))
    measured = next(t for f in figures(est) for t in f.data if t["name"] == "measured")
    assert max(measured["y"]) == pytest.approx(y.max(), rel=1e-4)
    assert measured["x"] == sorted(measured["x"])
    assert len(measured["x"]) <= 2000
    assert np.max(measured["y"]) > 40


def test_what_was_done_on_the_way_is_said(tmp_path):
    r = fq.white_noise(1500, seed=2)
    record = fq.simulate(fq.first_order(), r, 1e-3).with_noise(0.01)
    est = fq.fit(fq.first_order(), fq.Record(record.u, record.y, 1e-3, reference=r))
    est.report(tmp_path / "r.html")
    assert est.notes
    assert est.notes[0].split(":")[0] in (tmp_path / "r.html").read_text().replace("&#39;", "'")


def test_one_record_of_two_inputs_shows_the_response_of_each(tmp_path):
    def two(a, b):
        return [[-a, 0.2], [0, -b]], [[a, 0], [0, b]], [[1, 0], [0.3, 1]], None

    plant = fq.GreyBox(
        two, [fq.Parameter("a", 10.0), fq.Parameter("b", 30.0)], inputs=["left", "right"],
        outputs=["x", "z"],
    )  # fmt: skip
    u = np.random.default_rng(0).standard_normal((4000, 2))
    est = fq.fit(plant, fq.simulate(plant, u, 1e-2).with_noise(0.01, seed=1))
    drawn = [f for f in figures(est) if f.title.startswith("Frequency response")]
    assert [f.title for f in drawn] == [
        f"Frequency response, {i} to {o}" for o in ("x", "z") for i in ("left", "right")
    ]
    assert all("local polynomials" in f.note for f in drawn)
    for pair, figure in zip(np.ndindex(2, 2), drawn, strict=True):
        points = next(part for part in figure.data if part["name"] == "data")
        f, shown = np.array(points["x"]), np.array(points["y"])
        G = plant.frequency_response(2 * np.pi * f, fq.ZeroOrderHold(1e-2)).response[pair]
        np.testing.assert_allclose(shown, np.abs(G), atol=0.03)


def test_a_page_of_something_else_is_not_replaced(tmp_path):
    record = fq.simulate(fq.first_order(), fq.white_noise(300, seed=1), 1e-3)
    est, page = fq.fit(fq.first_order(), record), tmp_path / "mine.html"
    page.write_text("<html>my notes</html>")
    with pytest.raises(ValueError, match="is there already"):
        est.report(page)
    assert "my notes" in page.read_text()
    est.report(page, overwrite=True)
    # a report takes the place of another
    est.report(page, title="Again")
    assert "Again" in page.read_text(encoding="utf-8")


def test_tests_that_fail_and_leave_no_doubt_are_not_red(tmp_path):
    """Coloured noise, trusted: "failed" had stood in red below "Nothing speaks against"."""
    lag, rng = fq.first_order(b=20.0, a=10.0), np.random.default_rng(1)
    clean = fq.simulate(lag, fq.white_noise(2000, seed=2), 0.02)
    e = 0.02 * scipy.signal.lfilter([1], [1, -0.9], rng.standard_normal(2000))
    record = fq.Record(clean.u, clean.y + e, clean.dt, output_names=['q"1" <b>'])
    est = fq.fit(lag, record, weights="noise")
    assert est.verdict.trusted
    page = tmp_path / "coloured.html"
    est.report(page)
    text = page.read_text(encoding="utf-8")
    assert '<td class="failed">' not in text
    assert '<td class="faint">failed</td>' in text
    assert "What failed has been weighed" in text
    # a label of a picture may hold marks, but no quotes as marks
    assert "&amp;quot;" not in text
    assert "q\\u0026quot;" not in text
