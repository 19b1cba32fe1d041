"""Robot logs, each written by its own library, read to the bit."""

import sys

import numpy as np
import pytest

import freqid as fq

RNG = np.random.default_rng(0)
FAST = 1e-3 * (np.arange(400) + 0.2 * RNG.random(400))
SLOW = 4e-3 * np.arange(100) + 0.3e-3
TORQUE, VELOCITY = RNG.standard_normal(400), RNG.standard_normal((100, 3))


@pytest.fixture(params=["apart", "inside another program"], autouse=True)
def place(request, monkeypatch):
    """Where the libraries read: in a process of their own, or where there is no interpreter."""
    if request.param != "apart":
        monkeypatch.setattr(sys, "frozen", True, raising=False)


def nanoseconds(t):
    return round(t * 1e9)


@pytest.fixture(params=["bag", "mcap", "db3"])
def bag(request, tmp_path):
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    ros1 = request.param == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    Joint = store.types["sensor_msgs/msg/JointState"]
    Number = store.types["std_msgs/msg/Float64"]
    Header, Time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    path = tmp_path / ("log.bag" if ros1 else "log")
    if ros1:
        writer, pack = Writer1(path), store.serialize_ros1
    else:
        plugin = StoragePlugin.MCAP if request.param == "mcap" else StoragePlugin.SQLITE3
        writer, pack = Writer2(path, version=9, storage_plugin=plugin), store.serialize_cdr
    with writer:
        names = "std_msgs/msg/Float64", "sensor_msgs/msg/JointState"
        torque, joints = (
            writer.add_connection(topic, kind, typestore=store)
            for topic, kind in zip(("/torque", "/joint_states"), names, strict=True)
        )
        for t, x in zip(FAST, TORQUE, strict=True):
            writer.write(torque, nanoseconds(t), pack(Number(data=x), names[0]))
        empty = np.array([])
        for i, (t, v) in enumerate(zip(SLOW, VELOCITY, strict=True)):
            ns = nanoseconds(t)
            stamp = Time(sec=100 + ns // 10**9, nanosec=ns % 10**9)
            more = {"seq": i} if ros1 else {}
            message = Joint(
                Header(stamp=stamp, frame_id="", **more), ["a", "b", "c"], empty, v, empty
            )
            # the log writes later than the sensor stamps
            writer.write(joints, ns + 5_000_000, pack(message, names[1]))
    return path if request.param != "mcap" else next(path.glob("*.mcap"))


@pytest.mark.study
def test_bags(bag):
    found = fq.channels(bag)
    assert set(found.index) == {"torque.data", *(f"joint_states.velocity[{i}]" for i in range(3))}
    row = found.loc["joint_states.velocity[1]"]
    assert row["rate"] == pytest.approx(250, rel=1e-6)
    assert row["jitter"] < 1e-6
    assert row["samples"] == 100
    assert found["jitter"]["torque.data"] > 3e-5
    from freqid.data.logged import log_of

    log = log_of(bag)
    assert (log["torque.data"].values == TORQUE).all()
    assert np.allclose(log["torque.data"].times, FAST, rtol=0, atol=1e-9)
    assert (log["joint_states.velocity[2]"].values == VELOCITY[:, 2]).all()
    # the headers' own stamps, and not those of the log
    assert np.allclose(log["joint_states.velocity[2]"].times, 100 + SLOW, rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match=r"did you mean 'joint_states.velocity\[1\]'"):
        fq.read(bag, "torque.data", "joint_state.velocity[1]")
    with pytest.raises(ValueError, match="do not overlap"):
        fq.read(bag, "torque.data", "joint_states.velocity[1]")


def test_a_bag_that_ends_early(bag, tmp_path):
    whole = bag if bag.is_file() else next(bag.glob("*.db3"))
    short = tmp_path / f"short{whole.suffix}"
    short.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(ValueError, match="short"):
        fq.read(short, "torque.data", "torque.data")


def test_mdf(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(TORQUE, FAST, name="torque", unit="N m")])
    file.append(
        [asammdf.Signal(v, SLOW, name=f"v{i}", unit="rad/s") for i, v in enumerate(VELOCITY.T)]
    )
    path = file.save(tmp_path / "log.mf4")
    file.close()
    found = fq.channels(path)
    assert found["unit"].to_dict() == {"torque": "N m", **{f"v{i}": "rad/s" for i in range(3)}}
    record = fq.read(path, "torque", ["v0", "v2"])
    assert record.units == {"torque": "N m", "v0": "rad/s", "v2": "rad/s"}
    assert (record.y_logged == VELOCITY[:, [0, 2]]).all()
    assert (record.u_time == FAST).all()
    if not hasattr(sys, "frozen"):
        # what asammdf could not open it cannot close, and Python says so wherever that happens
        (tmp_path / "cut.mf4").write_bytes(path.read_bytes()[:40])
        with pytest.raises(ValueError, match=r"cut\.mf4"):
            fq.channels(tmp_path / "cut.mf4")


def test_ulog(measured):
    pytest.importorskip("pyulog")
    from pyulog import ULog

    path = measured / "logs" / "sample_log_small.ulg"
    found = fq.channels(path)
    gyro = "vehicle_angular_velocity.xyz[0]"
    # the rates of SOURCES.md
    assert found["rate"]["actuator_controls_0.control[0]"] == pytest.approx(278.7, abs=0.2)
    assert found["rate"]["sensor_combined.gyro_rad[0]"] == pytest.approx(199.7, abs=0.2)
    assert found["rate"]["actuator_outputs.output[0]"] == pytest.approx(10, abs=0.2)
    record = fq.read(path, "actuator_controls_0.control[0]", gyro)
    raw = {d.name: d.data for d in ULog(str(path)).data_list if d.multi_id == 0}
    stamps = raw["actuator_controls_0"]["timestamp"] * 1e-6
    assert (record.u_time == stamps).all()
    # samples before the first input, whose input nobody knows, are left out
    seen = raw["vehicle_angular_velocity"]["timestamp"] * 1e-6 >= stamps[0]
    assert (record.y_logged[:, 0] == raw["vehicle_angular_velocity"]["xyz[0]"][seen]).all()
    assert any("without an input were left out" in note for note in record.notes)
    assert any("missing" in note for note in record.notes)
    with pytest.raises(ValueError, match="time='t' is for tables"):
        fq.read(path, "actuator_controls_0.control[0]", gyro, time="t")
    with pytest.raises(ValueError, match=r"dt=0\.01 is for tables"):
        fq.read(path, "actuator_controls_0.control[0]", gyro, dt=0.01)
    with pytest.raises(ValueError, match="name outputs="):
        fq.read(path, "actuator_controls_0.control[0]")
    with pytest.raises(ValueError, match="several clocks"):
        fq.read(path, "actuator_controls_0.control[0]", [gyro, "sensor_combined.gyro_rad[0]"])


def test_inputs_of_several_clocks_are_held(measured):
    pytest.importorskip("pyulog")
    path = measured / "logs" / "sample_log_small.ulg"
    names = ["actuator_outputs.output[0]", "actuator_controls_0.control[0]"]
    record = fq.read(path, names, "vehicle_angular_velocity.xyz[0]")
    assert record.u_logged.shape[1] == 2
    changes = np.flatnonzero(np.diff(record.u_logged[:, 0]))
    assert len(changes) < 70


def test_channels_on_the_command_line(tmp_path, capsys):
    from freqid.cli.commands import main

    fq.write(fq.simulate(fq.first_order(), np.ones(50), 0.01), tmp_path / "r.csv")
    with pytest.raises(SystemExit) as end:
        main(["channels", str(tmp_path / "r.csv")])
    assert end.value.code == 0
    assert "rate" in capsys.readouterr().out


@pytest.mark.study
@pytest.mark.parametrize(
    ("formula", "read"), [("2 * X1 + 1", True), ("print(X1)", False), ("X1.__class__", False)]
)
def test_formulas_of_mdf_are_arithmetic_or_refused(formula, read, tmp_path):
    """Others were run as Python where there is a sympy, and else left the raw values."""
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    counts = np.arange(400, dtype="i2")
    file.append([asammdf.Signal(counts, FAST, name="u", conversion={"formula": formula})])
    file.append([asammdf.Signal(TORQUE, FAST, name="y")])
    path = file.save(tmp_path / "log.mf4")
    file.close()
    if read:
        assert (fq.read(path, "u", "y").u_logged[:, 0] == 2 * counts + 1).all()
        return
    with pytest.raises(ValueError, match=r"log\.mf4: .*formula"):
        fq.read(path, "u", "y")
