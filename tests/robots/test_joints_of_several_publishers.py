"""Joint states of a topic on which messages do not all name the same joints."""

import numpy as np
import pytest

import freqid as fq
from freqid.data.logged import log_of

TIME = 1.8e9 + 0.01 * np.arange(300)
RNG = np.random.default_rng(0)
TORQUE, ARM, GRIP = RNG.standard_normal(300), RNG.standard_normal((300, 2)), RNG.random((300, 1))


def nanoseconds(t):
    return round((t - 1.8e9) * 1e9) + 1_800_000_000 * 10**9


def bag(path, messages):
    """A ROS 2 bag of joint states (time, names, velocities) beside torques."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = "std_msgs/msg/Float64", "sensor_msgs/msg/JointState"
    Number, Joint = (store.types[k] for k in kinds)
    Header, Time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        torque, joints = (
            writer.add_connection(topic, kind, typestore=store)
            for topic, kind in zip(("/torque", "/joint_states"), kinds, strict=True)
        )
        for t, x in zip(TIME, TORQUE, strict=True):
            writer.write(torque, nanoseconds(t), store.serialize_cdr(Number(data=x), kinds[0]))
        for t, names, v in messages:
            ns = nanoseconds(t)
            stamp = Time(sec=ns // 10**9, nanosec=ns % 10**9)
            message = Joint(
                Header(stamp=stamp, frame_id=""), list(names), np.array([]), np.array(v, float),
                np.array([]),
            )  # fmt: skip
            writer.write(joints, ns, store.serialize_cdr(message, kinds[1]))
    return path


def test_an_arm_and_a_gripper_on_one_topic(tmp_path):
    """velocity[0] had been the arm's and the gripper's by turns: half of a gain, trusted."""
    arm = [(t, ("hip", "knee"), v) for t, v in zip(TIME, ARM, strict=True)]
    grip = [(t + 0.003, ("grip",), v) for t, v in zip(TIME, GRIP, strict=True)]
    log = log_of(bag(tmp_path / "log", [m for pair in zip(arm, grip, strict=True) for m in pair]))
    for i, name in enumerate(("hip", "knee")):
        assert (log[f"joint_states.velocity[{name}]"].values == ARM[:, i]).all()
    assert (log["joint_states.velocity[grip]"].values == GRIP[:, 0]).all()
    assert "joint_states.velocity[0]" not in log
    # one of them has nothing from before it, and each its own clock
    with pytest.raises(ValueError, match=r"joint_states\.velocity\["):
        fq.read(tmp_path / "log", "torque.data", "joint_states.velocity[0]")
    record = fq.read(tmp_path / "log", "torque.data", "joint_states.velocity[knee]")
    assert record.dt == pytest.approx(0.01)
    assert np.allclose(record.y, ARM[: record.n_samples, 1])


def test_names_in_another_order(tmp_path):
    messages = [
        (t, ("hip", "knee"), v) if i % 3 else (t, ("knee", "hip"), v[::-1])
        for i, (t, v) in enumerate(zip(TIME, ARM, strict=True))
    ]
    log = log_of(bag(tmp_path / "log", messages))
    for i, name in enumerate(("hip", "knee")):
        assert (log[f"joint_states.velocity[{name}]"].values == ARM[:, i]).all()
        assert (np.diff(log[f"joint_states.velocity[{name}]"].times) > 0).all()


def test_messages_of_no_joints_change_no_name(tmp_path):
    named = [(t, ("hip", "knee"), v) for t, v in zip(TIME, ARM, strict=True)]
    messages = [(TIME[0] - 0.01, (), ()), *named]
    log = log_of(bag(tmp_path / "log", messages))
    assert (log["joint_states.velocity[1]"].values == ARM[:, 1]).all()


def frames_bag(path):
    """Wrenches of two frames on one topic, and trajectories whose joints change their order."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = [f"geometry_msgs/msg/{n}" for n in ("WrenchStamped", "Wrench", "Vector3")]
    kinds += ["std_msgs/msg/Header", "builtin_interfaces/msg/Time"]
    kinds += ["trajectory_msgs/msg/JointTrajectory", "trajectory_msgs/msg/JointTrajectoryPoint"]
    Stamped, Wrench, Vector, Header, Time, Trajectory, Point = (store.types[k] for k in kinds)
    Duration, none = store.types["builtin_interfaces/msg/Duration"], np.array([])
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        force, moves = (
            writer.add_connection(topic, kind, typestore=store)
            for topic, kind in (("/force", kinds[0]), ("/moves", kinds[5]))
        )
        for i, (t, two) in enumerate(zip(TIME, ARM, strict=True)):
            ns = nanoseconds(t)
            stamp = Time(sec=ns // 10**9, nanosec=ns % 10**9)
            for frame, x in zip(("left", "right"), two, strict=True):
                wrench = Wrench(force=Vector(x=x, y=0.0, z=0.0), torque=Vector(x=0.0, y=0.0, z=0.0))
                message = Stamped(header=Header(stamp=stamp, frame_id=frame), wrench=wrench)
                writer.write(force, ns, store.serialize_cdr(message, kinds[0]))
            order = [0, 1] if i % 2 else [1, 0]
            still = Duration(sec=0, nanosec=0)
            point = Point(two[order].copy(), none, none, none, time_from_start=still)
            names = [("hip", "knee")[k] for k in order]
            message = Trajectory(Header(stamp=stamp, frame_id=""), names, [point])
            writer.write(moves, ns, store.serialize_cdr(message, kinds[5]))
    return path


def test_frames_on_one_topic_and_the_joints_of_commands(tmp_path):
    """They had been one signal by turns."""
    log = log_of(frames_bag(tmp_path / "log"))
    for i, (frame, joint) in enumerate((("left", "hip"), ("right", "knee"))):
        assert (log[f"force[{frame}].wrench.force.x"].values == ARM[:, i]).all()
        assert (log[f"moves.points[0].positions[{joint}]"].values == ARM[:, i]).all()
    assert "force.wrench.force.x" not in log
