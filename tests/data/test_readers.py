"""Every kind of file gives the same record; what is wrong with samples is named."""

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
import scipy.io

import freqid as fq


@pytest.fixture
def record():
    rng = np.random.default_rng(1)
    return fq.Record(rng.standard_normal(50), rng.standard_normal(50), 2e-3,
                     input_names=["motor"], output_names=["angle"])  # fmt: skip


def columns(record):
    return {"time": record.time, "motor": record.u, "angle": record.y}


def write_mat(path, data):
    scipy.io.savemat(path, data)


def write_struct(path, data):
    scipy.io.savemat(path, {"experiment": data})


def write_h5(path, data):
    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file[f"run/{name}"] = values


def write_mat73(path, data):
    # MATLAB 7.3: HDF5 behind a header of 512 bytes, row vectors as columns
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            file[name] = values[:, None]
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def write_uff(path, data):
    write_uff_channels(path, {n: (data["time"], data[n]) for n in ("motor", "angle")})


def write_uff_channels(path, channels, func_type=1, labels=None):
    """Channels (times, samples) by name, with labels of units."""
    labels = labels or {}
    units = {
        f"{axis}_{what}": value
        for axis in ("abscissa", "ordinate", "orddenom", "z_axis")
        for what, value in {
            "spec_data_type": 0, "len_unit_exp": 0, "force_unit_exp": 0, "temp_unit_exp": 0,
            "axis_units_lab": "NONE",
        }.items()
    }  # fmt: skip
    sets = [
        pyuff.prepare_58(
            func_type=func_type, ver_num=0, load_case_id=0, rsp_node=1, rsp_dir=1, ref_node=1,
            ref_dir=1,
            rsp_ent_name="NONE", ref_ent_name="NONE", ord_data_type=4, num_pts=len(x), data=y,
            x=x, id1=name, id2="NONE", id3="NONE", id4="NONE", id5="NONE", binary=0,
            abscissa_inc=x[1] - x[0], abscissa_spacing=1, abscissa_min=0.0, z_axis_value=0.0,
            **{**units, "ordinate_axis_units_lab": labels.get(name, "NONE")},
        )
        for name, (x, y) in channels.items()
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.csv", lambda p, d: pd.DataFrame(d).to_csv(p, index=False)),
        ("a.parquet", lambda p, d: pd.DataFrame(d).to_parquet(p)),
        ("a.npz", lambda p, d: np.savez(p, **d)),
        ("a.mat", write_mat),
        ("struct.mat", write_struct),
        ("new.mat", write_mat73),
        ("a.h5", write_h5),
        ("a.uff", write_uff),
    ],
)
def test_every_kind_of_file(record, tmp_path, name, write):
    write(tmp_path / name, columns(record))
    back = fq.read(tmp_path / name, inputs="motor", outputs="angle", units={"motor": "N m"})
    assert np.allclose(back.u, record.u, rtol=1e-6)
    assert np.allclose(back.y, record.y, rtol=1e-6)
    assert back.dt == pytest.approx(2e-3)
    assert back.units == {"motor": "N m"}


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_what_is_written_remembers_its_hold(record, tmp_path, kind):
    slow = fq.Record(record.u, record.y[::5], 1e-2, input_dt=2e-3, hold=fq.FirstOrderHold(2e-3))
    fq.write(slow, tmp_path / f"slow.{kind}")
    back = fq.read(tmp_path / f"slow.{kind}", inputs="u", outputs="y")
    assert back.hold == slow.hold
    assert back.factor == 5
    assert np.array_equal(back.y, slow.y)


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_what_is_written_remembers_conditions_and_each_inputs_hold(record, tmp_path, kind):
    made = fq.Record(
        np.column_stack([record.u, np.sign(record.y)]), record.y, 2e-3,
        hold={"torque": "zoh", "coulomb": "bl"}, input_names=["torque", "coulomb"],
    ).with_conditions(q=0.3, load=-5.0).decimate(2, keep_input=True)  # fmt: skip
    fq.write(made, tmp_path / f"arm.{kind}")
    back = fq.read(tmp_path / f"arm.{kind}", ["torque", "coulomb"], "y")
    assert back.conditions == {"q": 0.3, "load": -5.0}
    assert back.hold == made.hold
    picked = fq.Record.from_frame(made.to_frame().drop(columns="coulomb"), "torque", "y")
    assert picked.hold == fq.ZeroOrderHold(2e-3)


def test_matrices_become_channels(tmp_path):
    scipy.io.savemat(tmp_path / "m.mat", {"u": np.ones((9, 2)), "y": np.arange(9.0), "dt": 0.1})
    back = fq.read(tmp_path / "m.mat", inputs=["u1", "u2"], outputs="y")
    assert back.n_inputs == 2
    assert back.dt == pytest.approx(0.1)


def test_cut_and_detrended_on_reading(record, tmp_path):
    fq.write(record, tmp_path / "r.csv")
    back = fq.read(tmp_path / "r.csv", start=0.02, stop=0.08, detrend=0)
    assert back.n_samples == 30
    assert back.y.mean() == pytest.approx(0, abs=1e-12)


def test_gaps_jitter_and_blanks_are_errors_unless_resampled(tmp_path):
    t = 0.01 * np.arange(200)
    frame = pd.DataFrame({"time": t, "u": np.sin(3 * t), "y": np.cos(3 * t)})
    jittered = frame.assign(time=t + 1e-4 * np.random.default_rng(0).uniform(-1, 1, 200))
    cases = {
        "gap": (frame.drop(index=range(50, 60)), "gaps in time"),
        "jitter": (jittered, "jitter"),
        "blank": (frame.assign(y=frame["y"].where(frame.index % 50 != 7)), "4 missing samples"),
    }
    for name, (broken, note) in cases.items():
        path = tmp_path / f"{name}.csv"
        broken.to_csv(path, index=False)
        with pytest.raises(ValueError, match=path.name):
            fq.read(path)
        record = fq.read(path, resample=True)
        assert any(note in n for n in record.notes)
        assert np.abs(record.y - np.cos(3 * record.time)).max() < 5e-3
        assert note in fq.check_record(record)["meaning"].str.cat()
    shuffled = frame.iloc[::-1]
    shuffled.to_csv(tmp_path / "back.csv", index=False)
    with pytest.raises(ValueError, match="increase"):
        fq.read(tmp_path / "back.csv", resample=True)


def test_steps_of_seconds_are_said(tmp_path):
    path = tmp_path / "t.csv"
    pd.DataFrame({"time": 10 * np.arange(50), "u": 1.0, "y": np.arange(50.0)}).to_csv(path)
    assert any("units={'time': 'ms'}" in note for note in fq.read(path, "u", "y").notes)
    told = fq.read(path, "u", "y", units={"time": "ms"})
    assert told.dt == pytest.approx(0.01)
    assert not any("units=" in note for note in told.notes)


def test_pickles_are_not_opened(tmp_path):
    np.savez(tmp_path / "bad.npz", u=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ValueError, match="plain arrays"):
        fq.read(tmp_path / "bad.npz")


@pytest.mark.parametrize("suffix", ["parquet", "mat", "npz", "h5", "uff"])
def test_damaged_files_say_so(tmp_path, suffix):
    (tmp_path / f"bad.{suffix}").write_bytes(b"this is not what it says it is" * 40)
    with pytest.raises(ValueError, match="bad"):
        fq.read(tmp_path / f"bad.{suffix}", inputs="u", outputs="y")


def test_check_record_names_bad_channels(rng):
    t = 1e-3 * np.arange(4000)
    good = np.sin(30 * t) + 0.1 * rng.standard_normal(4000)
    stuck = good.copy()
    stuck[1000:1600] = stuck[1000]
    record = fq.Record(
        good, np.stack([np.clip(good, -0.8, 2), stuck, np.round(good, 1), 0 * good, good + 50], 1),
        1e-3, output_names=["clipped", "stuck", "coarse", "dead", "shifted"],
        reference=rng.standard_normal(4000),
    )  # fmt: skip
    found = fq.check_record(record)
    pairs = set(zip(found["channel"], found["finding"], strict=True))
    assert pairs == {
        ("clipped", "saturated"), ("stuck", "stuck"), ("coarse", "quantised"),
        ("dead", "constant"), ("shifted", "offset"), ("reference", "unrelated reference"),
    }  # fmt: skip
    assert found.set_index("channel").loc["coarse", "value"] == pytest.approx(0.1)
    assert len(fq.check_record(fq.Record(good, good, 1e-3))) == 0


def test_units_of_a_uff_are_kept(tmp_path, record):
    data = columns(record)
    channels = {n: (data["time"], data[n]) for n in ("motor", "angle")}
    write_uff_channels(tmp_path / "a.uff", channels, labels={"motor": "N", "angle": "m/s2"})
    back = fq.read(tmp_path / "a.uff", inputs="motor", outputs="angle")
    assert back.units == {"motor": "N", "angle": "m/s2"}
    assert (back.input_names, back.output_names) == (("motor",), ("angle",))


def test_a_uff_of_responses_is_sent_to_its_reader(tmp_path, record):
    data = columns(record)
    channels = {n: (data["time"], data[n]) for n in ("motor", "angle")}
    write_uff_channels(tmp_path / "a.uff", channels, func_type=4)
    with pytest.raises(ValueError, match="read_response reads it"):
        fq.read(tmp_path / "a.uff")


@pytest.mark.parametrize("lost", [False, True])
def test_a_slow_output_among_jittering_stamps_stays_slow(lost, tmp_path):
    """Four of five outputs were drawn by straight lines: an inertia 27 % off, at 28 bars."""
    lag, rng = fq.first_order(b=300.0, a=250.0), np.random.default_rng(3)
    fast = fq.simulate(lag, fq.white_noise(4000, seed=1), 1e-3)
    y = fast.y + 0.01 * fast.y.std() * rng.standard_normal(4000)
    stamps = 1e-3 * np.arange(4000) + 2e-5 * rng.uniform(-1, 1, 4000)
    frame = pd.DataFrame(
        {"time": stamps, "u": fast.u, "y": np.where(np.arange(4000) % 5, np.nan, y)}
    )
    if lost:
        frame = frame.drop(index=2002)
    frame.to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(ValueError, match="resample=True"):
        fq.read(tmp_path / "log.csv", inputs="u")
    record = fq.read(tmp_path / "log.csv", inputs="u", resample=True)
    if lost:
        # rows that are lost would have others stand for their outputs: all are drawn, as it says
        assert record.factor == 1
        assert any("missing samples of 'y'" in note for note in record.notes)
        return
    assert (record.factor, record.dt, record.n_samples) == (5, pytest.approx(5e-3), 800)
    assert not any("missing" in note for note in record.notes)
    est = fq.fit(lag, record)
    assert est.verdict.trusted
    assert est["a"] == pytest.approx(250, rel=0.05)


@pytest.mark.parametrize("times", [2, 5])
def test_a_sensor_that_repeats_itself_is_told_so(times):
    """It was "saturated: the sensor or the drive was overloaded", and the fit a mere doubt."""
    clean = fq.simulate(fq.first_order(), fq.white_noise(3000, seed=1), 1e-3).with_noise(0.01)
    repeated = fq.Record(clean.u, np.repeat(clean.y[::times], times), 1e-3)
    (found,) = fq.check_record(repeated).to_dict("records")
    assert (found["channel"], found["finding"], found["value"]) == ("y", "repeated", times)
    # what it says to do is right
    dt = repeated.dt
    said = eval(
        found["meaning"].split("all inputs, ")[1],
        {"Record": fq.Record, "u": repeated.u, "y": repeated.y, "dt": dt},
    )
    est = fq.fit(fq.first_order(), said)
    assert est.verdict.trusted
    assert est["a"] == pytest.approx(fq.first_order()["a"], rel=0.05)
    # an input that a slow converter held is neither that nor at a limit
    held = fq.simulate(fq.first_order(), np.repeat(clean.u[::times], times), 1e-3)
    assert not len(fq.check_record(held))
