"""Calls as the interface's text has them, where a signature has another order, name or place."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq

DT = 1e-3
LAG = fq.first_order(b=50, a=20)


@pytest.fixture(scope="module")
def record():
    return fq.simulate(LAG, fq.white_noise(3000), DT)


def test_read_by_position(tmp_path, record):
    """path, inputs, outputs, time, dt, sep, decimal, units, resample; and dt, hold, reference."""
    path = tmp_path / "log.csv"
    frame = pd.DataFrame({"motor": record.u, "angle": record.y})
    frame.to_csv(path, index=False)
    by_time = fq.read(path, "motor", "angle", None, DT, ",", ".", {"angle": "rad"})
    assert by_time.dt == DT
    assert by_time.units == {"angle": "rad"}
    np.testing.assert_array_equal(by_time.y, record.y)
    assert fq.read(path, "motor", "angle", DT).dt == DT
    assert fq.read(path, "motor", "angle", DT, "foh").hold == fq.FirstOrderHold(DT)
    frame.insert(0, "clock", np.arange(3000) * DT)
    frame.to_csv(path, index=False, sep=";")
    seen = fq.read(path, "motor", "angle", "clock", None, ";")
    assert seen.dt == pytest.approx(DT)
    with pytest.raises(TypeError, match="dt"):
        fq.read(path, "motor", "angle", DT, dt=DT)
    for time in ("clok", 5):
        with pytest.raises(ValueError, match=f"time={time!r}"):
            fq.read(path, "motor", "angle", time=time)
    with pytest.raises(ValueError, match="hold=5"):
        fq.read(path, "motor", "angle", DT, 5)


def test_the_time_by_its_header(tmp_path, record):
    path = tmp_path / "log.csv"
    t = np.arange(3000)
    columns = {"t [ms]": t, "motor [N m]": record.u, "angle": record.y, "other": t % 7}
    pd.DataFrame(columns).to_csv(path, index=False)
    for time in ("t [ms]", "t"):
        seen = fq.read(path, inputs="motor [N m]", outputs="angle", time=time)
        assert seen.dt == pytest.approx(DT)
        assert seen.units["motor"] == "N m"


def test_streams_of_blocks_have_the_names_of_their_channels(record):
    wanted = fq.h1(record, 500).response
    rows = np.column_stack([record.u, record.y])

    def arrays():
        return (rows[i : i + 700] for i in range(0, 3000, 700))

    def tables():
        # in another order
        return (pd.DataFrame({"angle": b[:, 1], "motor": b[:, 0]}) for b in arrays())

    for source in (rows, arrays(), arrays, tables(), tables):
        stream = fq.open(source, inputs=["motor"], outputs="angle", dt=DT)
        assert (stream.input_names, stream.output_names) == (("motor",), ("angle",))
        np.testing.assert_allclose(fq.h1(stream, 500).response, wanted, rtol=1e-10)


def test_made_up_names_of_channels_are_places():
    """Of inputs="y", outputs="u" the second column is the input, as ever."""
    rows = np.column_stack([np.arange(8.0), -np.arange(8.0)])
    for source in (rows, lambda: iter([rows])):
        turned = fq.open(source, inputs="y", outputs="u", dt=DT)
        u, y = next(turned.stretches(8))
        np.testing.assert_array_equal(u[:, 0], rows[:, 1])
        np.testing.assert_array_equal(y[:, 0], rows[:, 0])
        half = fq.open(source, inputs="u", outputs="angle", dt=DT)
        assert half.output_names == ("angle",)
    three = fq.open(np.column_stack([rows, rows[:, 0]]), "channel2", ["channel1"], dt=DT)
    np.testing.assert_array_equal(next(three.stretches(8))[0][:, 0], rows[:, 1])


def test_the_strongest_suspect_is_what_is_said():
    """A delay of whole samples was second to the mode of a black box that imitates it."""
    late = fq.GreyBox(lambda b, a: ([[-a]], [[b]], [[1.0]], None), LAG.parameters, input_delay=0.03)
    for seed in range(4):
        seen = fq.simulate(late, fq.white_noise(1000, seed=seed), 0.01)
        est = fq.fit(LAG, seen.with_noise(0.2, seed=50 + seed))
        assert est.suspects.index[0] == est.warnings[0].kind == "delay"


def test_suspects_have_their_columns_where_nothing_is_asked():
    est = fq.asymptotic_fit(LAG, fq.ChirpSpectrum(1, 40), DT, "foh", fq.ZeroOrderHold(DT))
    assert [*est.suspects.columns] == [
        "statistic", "p_value", "size", "unit", "power", "largest_shift",
    ]  # fmt: skip


def test_what_a_sampled_model_makes_remembers_its_hold(record):
    held = fq.Record(record.u, record.y, DT, hold="foh")
    box = fq.fit(fq.OutputError(1, feedthrough=True), held)
    assert fq.simulate(box, record.u, DT).hold == fq.FirstOrderHold(DT)
    assert fq.simulate(LAG, record.u, DT).hold == fq.ZeroOrderHold(DT)


def test_a_response_validates_in_a_report(tmp_path, record):
    pytest.importorskip("jinja2")
    noisy = record.with_noise(0.02)
    est = fq.fit(LAG, noisy)
    at = np.linspace(1, 100, 40)
    good = LAG.frequency_response(2 * np.pi * at, hold=fq.ZeroOrderHold(DT))
    other = fq.FrequencyResponse(at, 0.2 * good.response, dt=DT, hold="zoh")
    for response, said in ((good, "Another response is explained to"), (other, "Validation: an")):
        est.report(tmp_path / "page.html", validation=response)
        page = (tmp_path / "page.html").read_text()
        assert said in page
        assert "Validation on another response, u to y" in page


def test_names_that_0_1_0_had():
    seen = LAG.frequency_response(2 * np.pi * np.arange(1.0, 20.0))
    np.testing.assert_array_equal(seen.select(limits=(3, 7)).frequency, [3, 4, 5, 6, 7])
    many = LAG.state_spaces(b=np.array([1.0, 2.0]), a=np.array([3.0, 4.0]))
    np.testing.assert_array_equal(many.A, [[[-3.0]], [[-4.0]]])
    np.testing.assert_array_equal(many.B, [[[1.0]], [[2.0]]])


@pytest.mark.parametrize("estimated", [fq.etfe, lambda r: fq.h1(r, 500), fq.local_polynomial])
def test_lines_are_selected_by_the_same_name_from_all_responses(record, estimated):
    """``etfe(...).select(band=...)`` was a TypeError: there the band went by another name."""
    seen = estimated(record)
    within = seen.select(band=(20, 30))
    np.testing.assert_array_equal(within.frequency, seen.select((20, 30)).frequency)
    np.testing.assert_array_equal(within.frequency, seen.select(limits=(20, 30)).frequency)
    assert 19.99 < within.frequency[0] < within.frequency[-1] < 30.01
    assert len(within.frequency) < len(seen.frequency)
    with pytest.raises(ValueError, match="band"):
        seen.select(band=(30, 20))
