"""The reproduction: printed numbers, computed numbers, and figures that show what they should."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq

DATA = Path(__file__).parents[2] / "data"


def test_equations_3_and_6_in_the_steady_state():
    table = fq.paper.equations().set_index(["equation", "quantity"])
    w, T1, T2 = 50.0, 0.5e-3, 5e-3

    def held(b, a, z, T):
        return b / a * (1 - np.exp(-a * T)) / (z - np.exp(-a * T))

    # closed form: the pole at which the slow hold answers 50 rad/s as the fast one does
    target = held(100, 100, np.exp(1j * w * T1), T1)
    z = np.exp(1j * w * T2)
    phi = np.real(z) - np.imag(z) * np.real(1 / target) / np.imag(1 / target)
    gain = np.real(target * (z - phi))
    a = -np.log(phi) / T2
    assert table.loc[("eq. 3", "pole"), "ours"] == pytest.approx(a, rel=1e-9)
    assert table.loc[("eq. 3", "numerator"), "ours"] == pytest.approx(
        a * gain / (1 - phi), rel=1e-9
    )
    for name, b, a in (("eq. 3", 135.1141, 142.9504), ("eq. 6", 98.0526, 96.9163)):
        assert table.loc[(name, "numerator"), "ours"] == pytest.approx(b, abs=5e-5)
        assert table.loc[(name, "pole"), "ours"] == pytest.approx(a, abs=5e-5)
        for column in ("remembered_hold", "lifted"):
            assert table.loc[(name, "pole"), column] == pytest.approx(100, rel=1e-8)


def test_the_record_of_a_sine_gives_equation_3_too():
    record = fq.simulate(fq.first_order(), fq.sine(50 / (2 * np.pi), 40, 0.5e-3), 0.5e-3)
    est = fq.fit(fq.first_order(), record.decimate(10), hold="zoh")
    assert est["b"] == pytest.approx(135.1141, rel=1e-3)
    assert est["a"] == pytest.approx(142.9504, rel=1e-3)


def test_equation_15():
    table = fq.paper.equations().set_index(["equation", "quantity"])["ours"]
    ours = [table[("eq. 15", q)] for q in ("s^2", "s", "1")]
    assert np.allclose(ours, [1.052e3, -6.80e3, 1.278e7], rtol=0.01)
    assert table[("eq. 15", "notch / Hz")] == pytest.approx(17.5, abs=0.06)
    assert (np.abs(fq.paper.study().black_box.model.zeros) > 1).all()


def test_table_2():
    table = fq.paper.table2()
    assert table.columns.tolist() == [
        "parameter", "nominal", "paper_zoh", "zoh", "paper_foh", "foh", "remembered_hold", "lifted",
    ]  # fmt: skip
    expected_zoh = {"Jm": 9.758e-4, "k": 1.951e5, "Ja": 15.92, "fm": 63.09e-3, "d": -230.7}
    expected_foh = {"Jm": 8.251e-4, "k": 1.331e5, "Ja": 9.505, "fm": 1.560e-3, "d": 7.151}
    for name in table.index:
        row = table.loc[name]
        assert row["zoh"] == pytest.approx(expected_zoh[name], rel=1e-3)
        assert row["foh"] == pytest.approx(expected_foh[name], rel=1e-3)
        assert row["remembered_hold"] == pytest.approx(row["nominal"], rel=2e-3)
        assert row["lifted"] == pytest.approx(row["nominal"], rel=1e-8)


def test_the_printed_numbers_lie_in_data_too():
    printed = pd.read_csv(DATA / "paper_table2.csv").set_index("parameter")
    table = fq.paper.table2()
    for column, ours in (("nominal", "nominal"), ("zoh", "paper_zoh"), ("foh", "paper_foh")):
        assert np.array_equal(printed[column], table[ours].to_numpy(dtype=float))
    printed = pd.read_csv(DATA / "paper_equations.csv")
    table = fq.paper.equations().dropna(subset="paper")
    assert printed["value"].tolist() == table["paper"].tolist()
    assert printed["quantity"].tolist() == table["quantity"].tolist()


def test_the_data_are_what_the_demo_writes(tmp_path):
    from freqid.cli.commands import main

    with pytest.raises(SystemExit) as end:
        main(["demo", "--out", str(tmp_path)])
    assert end.value.code == 0
    for name in ("chirp_fast.csv", "chirp_slow.csv"):
        ours, theirs = fq.read(tmp_path / name), fq.read(DATA / name)
        assert ours.hold == theirs.hold == fq.ZeroOrderHold(0.5e-3)
        assert np.allclose(ours.u, theirs.u, atol=1e-12)
        assert np.allclose(ours.y, theirs.y, rtol=1e-9, atol=1e-9)


def test_ten_figures_with_the_papers_line_styles(tmp_path):
    paths = fq.paper.figures(tmp_path)
    assert sorted(p.name for p in paths) == sorted(
        f"fig{n:02d}.{s}" for n in range(1, 11) for s in ("png", "pdf")
    )
    assert all(p.stat().st_size > 4000 for p in paths)
    styles = {
        1: "-|--",
        4: "-|--|-.",
        6: "-|--",
        7: "-|--|-.",
        8: "-|--|-.",
        9: "-|--|-.",
        10: "-|--",
    }
    for number, expected in styles.items():
        axis = fq.paper.figure(number).axes[0]
        drawn = [line.get_linestyle() for line in axis.get_lines() if line.get_marker() == "None"]
        assert "|".join(drawn[: expected.count("|") + 1]) == expected
        if number != 8:
            panels = fq.paper.figure(number).axes
            assert "rad/s" in panels[1].get_xlabel()
            assert panels[0].get_xscale() == "log"
    with pytest.raises(ValueError, match="number=11"):
        fq.paper.figure(11)


def test_figure_10_shows_the_estimate_on_the_fast_plant():
    true, estimate = (line.get_ydata() for line in fq.paper.figure(10).axes[0].get_lines()[:2])
    omega = fq.paper.figure(10).axes[0].get_lines()[0].get_xdata()
    inside = (omega > 2 * np.pi * 22) & (omega < 2 * np.pi * 60)
    assert np.median(np.abs(estimate / true - 1)[inside]) < 0.05
    assert np.median(np.abs(estimate / true - 1)[omega < 60]) > 0.3
