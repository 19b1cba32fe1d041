"""Tables of polars, pyarrow, xarray and nonlinear_benchmarks are records and responses."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
import xarray as xr

import freqid as fq
from freqid.checks import InputError

T = np.arange(40) * 5e-3
U, Y = np.sin(T * 100), np.cos(T * 70)


def tables():
    columns = {"time": T, "torque": U, "speed": Y}
    at = ("time", T)
    return {
        "pandas": pd.DataFrame(columns),
        "polars": pl.DataFrame(columns),
        "pyarrow": pa.table(columns),
        "xarray": xr.Dataset({"torque": ("time", U), "speed": ("time", Y)}, {"time": T}),
        "xarray, an array": xr.DataArray(
            np.c_[U, Y], [at, ("channel", ["torque", "speed"])], name="axis"
        ),
    }


@pytest.mark.parametrize("library", tables())
def test_each_library_gives_the_same_record(library):
    record = fq.Record.from_frame(tables()[library], inputs="torque", outputs="speed")
    assert record.dt == 5e-3
    assert record.input_names == ("torque",)
    assert record.output_names == ("speed",)
    np.testing.assert_array_equal(record.u, U)
    np.testing.assert_array_equal(record.y, Y)


def test_stamps_of_polars_are_times():
    start = np.datetime64("2026-01-05T08:00:00", "us")
    stamps = start + np.round(T * 1e6).astype("timedelta64[us]")
    frame = pl.DataFrame({"time": stamps, "u": U, "y": Y})
    assert fq.Record.from_frame(frame).dt == pytest.approx(5e-3, rel=1e-12)


def test_units_of_xarray_are_kept():
    data = xr.Dataset({"u": ("time", U, {"units": "Nm"}), "y": ("time", Y)}, {"time": T})
    assert dict(fq.Record.from_frame(data).units) == {"u": "Nm"}


def test_a_benchmark_data_set_brings_its_sample_time_and_its_channels():
    data = SimpleNamespace(u=np.c_[U, Y], y=Y, sampling_time=2e-3)
    record = fq.Record.from_frame(data)
    assert record.dt == 2e-3
    assert record.input_names == ("u1", "u2")
    assert record.output_names == ("y",)


def test_a_response_in_polars():
    frf = fq.FrequencyResponse([1.0, 2.0], [1j, 0.5])
    back = fq.FrequencyResponse.from_frame(pl.from_pandas(frf.to_frame()))
    np.testing.assert_array_equal(back.response, frf.response)
    table = pl.DataFrame({"Frequency [Hz]": [1.0, 2.0], "Mag [dB]": [20.0, 0.0], "Phase": [0, 90]})
    found = fq.FrequencyResponse.from_frame(table)
    np.testing.assert_allclose(found.response[0, 0], [10, 1j], atol=1e-15)


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        (pl.DataFrame({"u": [1.0]}).lazy(), "LazyFrame; collect"),
        ([1.0, 2.0], "list; expected a DataFrame"),
        (xr.Dataset({"u": (("a", "b"), np.ones((2, 3)))}), "dimensions"),
        (xr.DataArray([1.0, 2.0]), "DataArray of the dimensions"),
        (SimpleNamespace(u=np.ones((2, 2, 2)), y=[1.0], sampling_time=1), "frame.u has the shape"),
        (SimpleNamespace(u=[1.0, 2.0], y=[1.0, 2.0], sampling_time=None), "give dt"),
        (
            SimpleNamespace(u=[1.0, 2.0], y=[1.0], sampling_time=1.0),
            "different lengths, {'u': 2, 'y': 1}",
        ),
    ],
)
def test_what_is_no_table_is_named(frame, says):
    with pytest.raises(ValueError, match=says):
        fq.Record.from_frame(frame)


@pytest.mark.parametrize(
    "made",
    [
        pytest.param(lambda t: {"time": t.strftime("%Y-%m-%d %H:%M:%S.%f").to_list()}, id="text"),
        pytest.param(
            lambda t: {"time": pd.array(t.strftime("%H:%M:%S.%f"), "string")}, id="string"
        ),
        pytest.param(lambda t: {"time": list(t.to_pydatetime())}, id="objects"),
        pytest.param(lambda t: pd.Index(list(t.to_pydatetime()), dtype=object), id="index"),
        pytest.param(lambda t: t.to_period("10ms"), id="periods"),
    ],
)
def test_times_in_memory_are_looked_at_as_those_of_files(made):
    stamps = pd.date_range("2024-01-01", periods=200, freq="10ms")
    time = made(stamps)
    columns = {"u": np.sin(np.arange(200.0)), "y": np.cos(np.arange(200.0))}
    if isinstance(time, dict):
        frame = pd.DataFrame({**time, **columns})
    else:
        frame = pd.DataFrame(columns, index=time)
    record = fq.Record.from_frame(frame, "u", "y")
    assert record.dt == pytest.approx(0.01, rel=1e-9)
    np.testing.assert_array_equal(record.u, columns["u"])


def test_a_duration_is_no_sample_time():
    with pytest.raises(InputError, match="finite real number"):
        fq.Record([0.0, 1.0], [0.0, 1.0], np.timedelta64(10, "ms"))


def test_an_empty_frame_is_told():
    empty = pd.DataFrame({"time": np.array([], object), "u": [], "y": []})
    with pytest.raises(InputError, match="0 rows"):
        fq.Record.from_frame(empty, "u", "y")


@pytest.mark.parametrize("unit", ["ms", "milliseconds", "ms since 2020-01-01"])
@pytest.mark.parametrize("name", ["time", "t"])
def test_the_unit_of_the_time_stands_at_its_coordinate(unit, name):
    """It was left out: a sample time of 1 s, without a word."""
    at = {name: (name, 1e3 * T, {"units": unit})}
    table = xr.Dataset({"torque": (name, U, {"units": "N m"}), "speed": (name, Y)}, at)
    for frame in (table, table.to_array("channel").T):
        record = fq.Record.from_frame(frame, inputs="torque", outputs="speed")
        assert record.dt == pytest.approx(T[1] - T[0])
        assert any(f"in {unit.split()[0]}" in note for note in record.notes)


def test_a_unit_of_the_time_is_one_of_an_index_too():
    frame = pd.DataFrame({"torque": U, "speed": Y}, pd.Index(1e3 * T, name="time"))
    named = fq.Record.from_frame(frame, inputs="torque", outputs="speed", units={"time": "ms"})
    assert named.dt == pytest.approx(T[1] - T[0])
    frame.attrs["units"] = {"time": "ms"}
    assert fq.Record.from_frame(frame, inputs="torque", outputs="speed").dt == named.dt


def test_runs_of_one_table_are_records_of_their_own(tmp_path):
    """Three of them had been glued together without a word."""
    t, u = 1e-3 * np.arange(300), np.sin(np.arange(300.0))
    frame = pd.DataFrame({"time": t, "run": np.arange(300) // 100, "u": u, "y": np.cumsum(u)})
    frame.to_csv(tmp_path / "runs.csv", index=False)
    glued = (
        fq.Record.from_frame(frame, inputs="u", outputs="y"),
        fq.read(tmp_path / "runs.csv", inputs="u", outputs="y"),
    )
    for record in glued:
        (note,) = [n for n in record.notes if "'run'" in n]
        assert "3 runs" in note
    run = fq.Record.from_frame(frame[frame["run"] == 1], inputs="u", outputs="y")
    assert not run.notes
    # a channel that is called so is one
    named = frame.rename(columns={"run": "test", "u": "run"})
    assert fq.Record.from_frame(named.drop(columns="test"), inputs="run", outputs="y").notes == ()
    # neither is a motor that runs at times, nor what is missing
    for run in (frame["run"] % 2, frame["run"].astype("Int64").where(frame["run"] > 0)):
        assert fq.Record.from_frame(frame.assign(run=run), inputs="u", outputs="y").notes == ()
    levels = frame.set_index(["run", "time"])
    with pytest.raises(InputError, match=r"2 levels, run, time.*xs\(\.\.\., level='run'\)"):
        fq.Record.from_frame(levels, inputs="u", outputs="y")
