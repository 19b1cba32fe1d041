"""What MATLAB's own tools log: structures of Simulink and dSPACE, series in time, objects."""

import struct

import numpy as np
import pytest
import scipy.io

import freqid as fq
from freqid.checks import InputError

N = 300
T = 1e-3 * np.arange(N)
U = np.sin(0.1 * np.arange(N) ** 1.2)
Y = np.cumsum(U) * 1e-3
SIGNAL = [("values", "O"), ("dimensions", "O"), ("label", "O")]
CHANNEL = [("Name", "O"), ("Data", "O"), ("Unit", "O"), ("XIndex", "O")]


def several(fields, *entries):
    """An array of structures."""
    found = np.zeros(len(entries), dtype=fields)
    found[:] = list(entries)
    return found


def block(x, label=""):
    """A To Workspace block that saves a structure with time."""
    signals = {"values": x[:, None], "dimensions": 1, "label": label}
    return {"time": T[:, None], "signals": signals, "blockName": "m/block"}


def saved(path, **variables):
    scipy.io.savemat(path, variables)
    return path


@pytest.mark.parametrize(
    "variables",
    [
        pytest.param(
            {"Scope": {"time": T[:, None],
                       "signals": several(SIGNAL, (U[:, None], 1, "u"), (Y[:, None], 1, "y")),
                       "blockName": "m/Scope"}}, id="scope"),
        pytest.param({"u": block(U), "y": block(Y), "tout": T}, id="blocks"),
        pytest.param({"a": block(U, "u"), "b": block(Y, "y")}, id="labels"),
        pytest.param(
            {"logs": {"time": np.zeros((0, 0)),
                      "signals": several(SIGNAL, (U, 1, "u"), (Y, 1, "y"))}, "tout": T},
            id="without time"),
        pytest.param({"u": {"Time": T, "Data": U, "Name": "in"},
                      "y": {"Time": T, "Data": Y, "Name": "out"}}, id="series"),
        pytest.param({"log": {"u": {"Time": T, "Data": U}, "y": {"Time": T, "Data": Y}}},
                     id="series in a structure"),
        pytest.param(
            {"tout": T, "log": {"u": {"Time": T, "Data": U}, "y": {"Time": T, "Data": Y}}},
            id="series in a structure beside a time"),
        pytest.param({"log": {"tout": T, "u": block(U), "y": block(Y)}}, id="blocks within one"),
        pytest.param({"tout": T, "a": {"b": {"u": block(U), "y": block(Y)}}}, id="deeper"),
        pytest.param({"day": {"in": {"time": T, "u": U}, "out": {"y": Y}}}, id="nested"),
    ],
)  # fmt: skip
def test_structures_are_read(tmp_path, variables):
    record = fq.read(saved(tmp_path / "a.mat", **variables))
    assert record.dt == pytest.approx(1e-3, rel=1e-12)
    assert (record.input_names, record.output_names) == (("u",), ("y",))
    np.testing.assert_array_equal(record.u, U)
    np.testing.assert_array_equal(record.y, Y)


def test_a_mux_is_columns_of_its_block_and_nameless_signals_are_numbered(tmp_path):
    both = {"time": T, "signals": {"values": np.c_[U, Y], "dimensions": 2, "label": ""}}
    record = fq.read(saved(tmp_path / "a.mat", simout=both))
    assert (record.input_names, record.output_names) == (("simout1",), ("simout2",))
    signals = several(SIGNAL, (U, 1, ""), (np.c_[Y, -Y], 2, ""))
    path = saved(tmp_path / "b.mat", scope={"time": T, "signals": signals})
    record = fq.read(path, inputs="scope1", outputs=["scope2_1", "scope2_2"])
    np.testing.assert_array_equal(record.y, np.c_[Y, -Y])


def test_a_recording_of_dspace_keeps_names_and_units(tmp_path):
    axis = several([("Name", "O"), ("Data", "O"), ("Unit", "O")], ("", T, "s"))
    names = '"Model Root"/"torque"/"Out1"', '"Model Root"/"speed"/"Out1"'
    signals = several(CHANNEL, (names[0], U, "Nm", 1), (names[1], Y, "-", 1))
    path = saved(tmp_path / "a.mat", rec1_001={"X": axis, "Y": signals, "Description": "x"})
    record = fq.read(path)
    assert record.input_names == ("Model Root/torque/Out1",)
    assert record.units["Model Root/torque/Out1"] == "Nm"
    assert "Model Root/speed/Out1" not in record.units
    assert record.dt == pytest.approx(1e-3, rel=1e-12)


def test_the_unit_of_a_recordings_time_counts(tmp_path):
    axis = several([("Name", "O"), ("Data", "O"), ("Unit", "O")], ("", 1e3 * T, "ms"))
    signals = several(CHANNEL, ("u", U, "", 1), ("y", Y, "", 1))
    path = saved(tmp_path / "a.mat", rec={"X": axis, "Y": signals})
    assert fq.read(path).dt == pytest.approx(1e-3, rel=1e-12)


def test_rasters_that_differ_are_refused(tmp_path):
    axis = several([("Name", "O"), ("Data", "O"), ("Unit", "O")], ("", T, "s"), ("", 2 * T, "s"))
    signals = several(CHANNEL, ("u", U, "", 1), ("y", Y, "", 2))
    path = saved(tmp_path / "a.mat", rec={"X": axis, "Y": signals})
    with pytest.raises(InputError, match="several rasters"):
        fq.read(path)


def test_blocks_with_times_of_their_own_are_not_mixed(tmp_path):
    late = block(Y) | {"time": 2 * T[:, None]}
    path = saved(tmp_path / "a.mat", u=block(U), y=late)
    with pytest.raises(
        InputError, match="several structures of the same names, u, y, which differ in 'time'"
    ):
        fq.read(path)


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def object_of(name, kind):
    """A variable as MATLAB keeps objects of classes: names, and what they stand for."""
    flags = element(6, struct.pack("<II", 13, 0)), element(5, struct.pack("<ii", 1, 1))
    stands_for = element(14, b"".join(flags) + element(1, b"") + element(6, struct.pack("<I", 5)))
    parts = element(6, struct.pack("<II", 17, 0)) + element(1, name) + element(1, b"MCOS")
    return element(14, parts + element(1, kind) + stands_for)


def test_objects_are_named_and_what_is_beside_them_is_read(tmp_path):
    beside = saved(tmp_path / "a.mat", time=T, u=U, y=Y)
    content = beside.read_bytes()
    alone = tmp_path / "b.mat"
    alone.write_bytes(content[:128] + object_of(b"out", b"timeseries"))
    with pytest.raises(InputError, match=r"out \(timeseries\).*x\.Data"):
        fq.read(alone)
    beside.write_bytes(content + object_of(b"log", b"timetable"))
    record = fq.read(beside)
    np.testing.assert_array_equal(record.u, U)
    assert any("log (timetable)" in note for note in record.notes)
    # several, which older scipy calls by one name
    beside.write_bytes(content + object_of(b"one", b"timetable") + object_of(b"log", b"timetable"))
    assert any("log (timetable)" in note for note in fq.read(beside).notes)


def test_groups_of_hdf5_that_share_their_time_are_read_together(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, x in (("u", U), ("y", Y)):
            file[f"{name}/time"], file[f"{name}/{name}"] = T, x
            file[f"{name}/{name}"].attrs["units"] = "Nm"
    record = fq.read(path)
    np.testing.assert_array_equal(record.y, Y)
    np.testing.assert_array_equal(fq.open(path, "u", "y").load().y, Y)
    assert record.units == {"u": "Nm", "y": "Nm"}
    with h5py.File(path, "a") as file:
        file["y/time"][...] = 2 * T
    with pytest.raises(InputError, match="several groups of the same names"):
        fq.read(path)
    # a stream took the first for both
    with pytest.raises(InputError, match="'y/time' tells other times than 'u/time'"):
        fq.open(path, "u", "y")
    assert fq.open(path, "u", "y", dt=1e-3).n_samples == N


def test_one_structure_keeps_the_names_of_its_fields(tmp_path):
    """Only samples that several series call alike are told apart by their structures."""
    path = saved(tmp_path / "a.mat", run={"time": T, "values": np.c_[U, Y]})
    record = fq.read(path, "values1", "values2")
    np.testing.assert_array_equal(record.y, Y)
    path = saved(tmp_path / "b.mat", run={"Time": T, "u": U, "y": Y})
    np.testing.assert_array_equal(fq.read(path, "u", "y", time="Time").u, U)


def test_properties_of_iddata_say_what_they_are(tmp_path):
    """The output stands first: it was taken for the input, and 4 ms for 4 s, without a word."""
    one = {"OutputData": Y[:, None], "InputData": U[:, None], "Ts": 1.0, "TimeUnit": "milliseconds"}
    record = fq.read(saved(tmp_path / "a.mat", z=one))
    np.testing.assert_array_equal(record.u, U)
    assert (record.input_names, record.output_names, record.dt) == (("u",), ("y",), 1e-3)
    words = {"InputName": ["F"], "OutputName": ["x"], "InputUnit": ["N"], "OutputUnit": ["mm"]}
    told = {name: np.array(word, object) for name, word in words.items()}
    record = fq.read(saved(tmp_path / "b.mat", z={**one, **told}))
    assert (record.input_names, record.units) == (("F",), {"F": "N", "x": "mm"})
    several = {**one, "OutputData": np.c_[Y, -Y], "InputData": np.c_[U, 2 * U], "Ts": []}
    several["SamplingInstants"] = 2.0 * np.arange(N)
    record = fq.read(saved(tmp_path / "c.mat", z=several), ["u1", "u2"], ["y1", "y2"])
    np.testing.assert_array_equal(record.y, np.c_[Y, -Y])
    assert record.dt == 2e-3


@pytest.mark.parametrize(("unit", "scale"), [("rad/TimeUnit", 2 * np.pi), ("Hz", 1.0), ("", 0.0)])
def test_properties_of_frd_are_a_response(tmp_path, unit, scale):
    f = np.linspace(0.5, 30, 120)
    G = 1 / (1 + 0.1j * f)
    told = {"Frequency": (scale or 2 * np.pi) * f, "ResponseData": G.reshape(1, 1, -1), "Ts": 0.002}
    path = saved(tmp_path / "a.mat", sys={**told, **({"FrequencyUnit": unit} if unit else {})})
    frf = fq.read_response(path)
    np.testing.assert_allclose(frf.frequency, f)
    np.testing.assert_allclose(frf.response[0, 0], G)
    assert frf.dt == 2e-3
