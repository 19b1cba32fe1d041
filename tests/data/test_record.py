"""Record, decimation, simulation, excitation, frames and files."""

import numpy as np
import pandas as pd
import pytest
import scipy.signal
from hypothesis import given, settings, strategies as st

import freqid as fq


def test_decimating_changes_dt_and_never_the_hold(fast):
    slow = fast.decimate(10)
    assert slow.dt == slow.input_dt == pytest.approx(5e-3)
    assert slow.hold == fast.hold == fq.ZeroOrderHold(0.5e-3)
    assert np.array_equal(slow.u, fast.u[::10])
    assert np.array_equal(slow.y, fast.y[::10])
    multi = fast.decimate(10, keep_input=True)
    assert np.array_equal(multi.u, fast.u)
    assert (multi.dt, multi.input_dt) == (pytest.approx(5e-3), 0.5e-3)


@given(st.integers(1, 6), st.integers(1, 6))
@settings(max_examples=20, deadline=None)
def test_decimating_twice_is_decimating_once(a, b):
    u = np.arange(200.0)
    record = fq.Record(u, u**2, dt=0.1)
    twice, once = record.decimate(a).decimate(b), record.decimate(a * b)
    assert np.array_equal(twice.y, once.y)
    assert twice.dt == pytest.approx(once.dt)


def test_antialias_keeps_the_relation_between_the_signals(plant, relative_error, rng):
    u = scipy.signal.lfilter([0.02], [1, -0.98], rng.standard_normal(40000))
    fast = fq.simulate(plant, u, dt=0.5e-3)
    plain, smooth = fast.decimate(10), fast.decimate(10, antialias=True)
    errors = [relative_error(fq.fit(plant, r, band=(8, 70)), plant) for r in (plain, smooth)]
    assert errors[1] < 0.02 < errors[0]


@pytest.mark.study
@pytest.mark.parametrize("keep_input", [False, True])
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_antialias_leaves_good_data_good(keep_input, pole):
    """The ends that a filter with padding made were called feedback and another mode in 7 of 16."""
    lag, dt, grades = fq.first_order(b=50.0, a=20.0), 2e-3, []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(10_000)
        y = fq.simulate(lag, u, dt).y
        noise = scipy.signal.lfilter(
            [np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(10_000)
        )
        record = fq.Record(u, y + 0.1 * y.std() * noise, dt)
        est = fq.fit(lag, record.decimate(5, keep_input=keep_input, antialias=True))
        grades.append(est.verdict.grade)
    assert grades.count("trust") >= 7, grades


def test_the_antialias_filter_passes_what_lies_below_and_nothing_above():
    t = np.arange(4000) * 1e-3
    low, high = np.sin(2 * np.pi * 40 * t), np.sin(2 * np.pi * 60 * t)
    slow = fq.Record(low, low + high, 1e-3).decimate(10, antialias=True)
    np.testing.assert_allclose(slow.u[5:-5], low[::10][5:-5], atol=0.01)
    np.testing.assert_allclose(slow.y[5:-5], low[::10][5:-5], atol=0.01)
    # its ends do not go on as waves do
    assert np.abs(slow.y - low[::10]).max() < 0.5
    line = np.linspace(1.0, 3.0, 1000)
    np.testing.assert_allclose(
        fq.Record(line, line, 1e-3).decimate(4, antialias=True).y, line[::4], atol=1e-12
    )


def test_records_are_immutable_and_copy_their_data():
    u = np.zeros(4)
    record = fq.Record(u, u, dt=0.1)
    u[0] = 5
    assert record.u[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        record.u[0] = 1
    with pytest.raises(AttributeError):
        record.dt = 2


def test_slice_detrend_noise():
    t = np.arange(100) * 0.1
    record = fq.Record(np.sin(t), 3 + 2 * t, dt=0.1, reference=t)
    part = record.slice(2, 5)
    assert part.n_samples == 30
    assert part.y[0] == pytest.approx(7)
    assert part.reference[0] == pytest.approx(2)
    assert np.abs(record.detrend(1).y).max() < 1e-12
    assert record.detrend().y.mean() == pytest.approx(0)
    noisy = fq.Record(np.zeros(20000), np.zeros(20000), dt=1).with_noise(0.3, seed=1)
    assert noisy.y.std() == pytest.approx(0.3, rel=0.02)
    assert np.array_equal(record.with_noise(1, seed=3).y, record.with_noise(1, seed=3).y)


def test_shapes_and_names():
    record = fq.Record(np.ones((5, 2)), np.ones((5, 3)), dt=0.1, output_names=["a", "b", "c"])
    assert (record.n_inputs, record.n_outputs, record.n_samples) == (2, 3, 5)
    assert record.input_names == ("u1", "u2")
    assert "a, b, c" in repr(record)
    assert "<table>" in record._repr_html_()


def test_simulate_is_exact_for_a_known_step():
    y = fq.simulate(fq.first_order(b=3, a=2), np.ones(50), dt=0.1).y
    assert np.abs(y - 1.5 * (1 - np.exp(-2 * 0.1 * np.arange(50)))).max() < 1e-14


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_simulate_agrees_with_lsim(hold, plant, rng):
    u = rng.standard_normal(400)
    x0 = [1e-3, 0.5, -2.0]
    ours = fq.simulate(plant, u, dt=5e-3, hold=hold, initial_state=x0).y
    t = np.arange(400) * 5e-3
    system = scipy.signal.StateSpace(*plant.state_space())
    _, theirs, _ = scipy.signal.lsim(system, u, t, X0=x0, interp=hold == "foh")
    assert np.abs(ours - theirs).max() < 1e-9 * np.abs(theirs).max()


def test_simulate_takes_control_systems_and_estimates(plant, fast):
    import control

    by_control = fq.simulate(plant.to_control(), fast.u, dt=0.5e-3)
    assert np.abs(by_control.y - fast.y).max() < 1e-10 * np.abs(fast.y).max()
    sampled = control.c2d(plant.to_control(), 0.5e-3)
    by_sampled = fq.simulate(sampled, fast.u, dt=0.5e-3)
    assert np.abs(by_sampled.y - fast.y).max() < 1e-6 * np.abs(fast.y).max()
    with pytest.raises(ValueError, match=r"discrete with dt=0\.0005"):
        fq.simulate(sampled, fast.u, dt=1e-3)


def test_band_limited_simulation_is_the_periodic_one():
    plant, dt, n = fq.first_order(), 1e-3, 1000
    u = fq.sine(8, 1, dt)
    y = fq.simulate(plant, u, dt, hold="bl").y
    G = plant.frequency_response([2 * np.pi * 8]).response[0, 0, 0]
    t = dt * np.arange(n)
    assert np.abs(y - np.abs(G) * np.sin(2 * np.pi * 8 * t + np.angle(G))).max() < 1e-12


def test_chirp_and_sine():
    u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
    t = 0.5e-3 * np.arange(20000)
    assert np.abs(u - np.cos(2 * np.pi * (10 * t + 3.5 * t**2))).max() < 1e-9
    sine = fq.chirp(10, 80, duration=1, dt=1e-3, phase=-90)
    assert sine[0] == pytest.approx(0)
    log = fq.chirp(1, 100, duration=10, dt=1e-3, method="log", amplitude=2)
    assert np.abs(log).max() == pytest.approx(2, rel=1e-3)


def test_frames_and_files_keep_everything(tmp_path, fast):
    for record in (
        fast.slice(0, 0.1),
        fast.slice(0, 0.1).decimate(10),
        fast.slice(0, 0.1).decimate(10, keep_input=True),
        fast.slice(0, 0.1).with_hold("foh"),
        fast.slice(0, 0.1).with_hold("bl"),
        fast.slice(0, 0.1).with_hold("foh").decimate(4),
    ):
        path = tmp_path / "r.csv"
        fq.write(record, path)
        again = fq.read(path)
        assert again.hold == record.hold
        assert (again.dt, again.input_dt) == (
            pytest.approx(record.dt),
            pytest.approx(record.input_dt),
        )
        assert np.array_equal(again.u, record.u)
        assert np.array_equal(again.y, record.y)
    assert [p.name for p in tmp_path.iterdir()] == ["r.csv"]


def test_from_frame_takes_time_indices():
    index = pd.date_range("2026-01-01", periods=4, freq="20ms", name="when")
    frame = pd.DataFrame({"a": [1.0, 2, 3, 4], "b": [0.0, 1, 2, 3]}, index=index)
    record = fq.Record.from_frame(frame, inputs=["a"], outputs=["b"])
    assert record.dt == pytest.approx(0.02)
    assert fq.Record.from_frame(frame.reset_index(drop=True), "b", "a", dt=0.5).input_names == (
        "b",
    )


BAD_FRAMES = {
    "not uniform": ({"time": [0, 0.1, 0.3], "u": [1.0, 1, 1], "y": [1.0, 1, 1]}, {}),
    "does not increase": ({"time": [0, 0.2, 0.1], "u": [1.0, 1, 1], "y": [1.0, 1, 1]}, {}),
    "NaN": ({"time": [0, 0.1, 0.2], "u": [1.0, 1, 1], "y": [1.0, 1, np.nan]}, {}),
    "give dt": ({"u": [1.0, 1, 1], "y": [1.0, 1, 1]}, {}),
    "steps by": ({"time": [0, 0.1, 0.2], "u": [1.0, 1, 1], "y": [1.0, 1, 1]}, {"dt": 0.2}),
    "inputs='v'": ({"time": [0, 0.1], "u": [1.0, 1], "y": [1.0, 1]}, {"inputs": "v"}),
    "name them": ({"time": [0, 0.1], "a": [1.0, 1], "b": [1.0, 1], "c": [1.0, 1]}, {}),
    "not numbers": ({"time": [0, 0.1], "u": ["x", "y"], "y": [1.0, 1]}, {}),
    "1 rows": ({"time": [0], "u": [1.0], "y": [1.0]}, {}),
}


@pytest.mark.parametrize("words", BAD_FRAMES)
def test_bad_frames_are_named(words):
    columns, options = BAD_FRAMES[words]
    with pytest.raises(ValueError, match=words):
        fq.Record.from_frame(pd.DataFrame(columns), **options)


def test_bad_files_are_named(tmp_path):
    def path(name, content):
        (tmp_path / name).write_bytes(content)
        return tmp_path / name

    with pytest.raises(FileNotFoundError, match=r"nowhere\.csv"):
        fq.read(tmp_path / "nowhere.csv")
    for name, content, words in (
        ("empty.csv", b"", "is empty"),
        ("names.csv", b"time,u,y\n", "no samples"),
        ("binary.csv", bytes(range(128, 256)) * 4, "is not CSV"),
        ("ragged.csv", b"time,u,y\n0,1,2\n0.1,1,2,3,4\n", "is not CSV or is damaged"),
        ("truncated.csv", b"time,u,y\n0,1,2\n0.1,1,2\n0.2,1", "NaN"),
        ("signal.xyz", b"\x00\x01", r"\.xyz is of no kind that is read"),
    ):
        with pytest.raises(ValueError, match=words):
            fq.read(path(name, content))
    with pytest.raises(ValueError, match="suffix"):
        fq.write(fq.Record([0.0, 1], [0.0, 1], 1), tmp_path / "r.doc")


def test_a_failed_write_leaves_the_old_file(tmp_path):
    from freqid.data.files import whole_file

    target = tmp_path / "a.txt"
    target.write_text("old")

    def interrupted():
        with whole_file(target) as beside:
            beside.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        interrupted()
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


ONE = np.ones(10)
BAD_RECORDS = {
    "u has 3 NaN": lambda: fq.Record([np.nan, np.inf, 1, np.nan], np.ones(4), 1),
    "dt=0 ": lambda: fq.Record(ONE, ONE, 0),
    "dt=-1": lambda: fq.Record(ONE, ONE, -1),
    "u has 10 samples": lambda: fq.Record(ONE, np.ones(9), 1),
    "y has shape": lambda: fq.Record(ONE, np.ones((2, 2, 2)), 1),
    "whole multiple": lambda: fq.Record(ONE, ONE, 1, input_dt=0.3),
    "names 2 of 1": lambda: fq.Record(ONE, ONE, 1, input_names=["a", "b"]),
    "name twice": lambda: fq.Record(ONE, ONE, 1, input_names=["a"], output_names=["a"]),
    "units=": lambda: fq.Record(ONE, ONE, 1, units={"z": "m"}),
    "reference has 3": lambda: fq.Record(ONE, ONE, 1, reference=np.ones(3)),
    "factor=0": lambda: fq.Record(ONE, ONE, 1).decimate(0),
    "factor=2.5": lambda: fq.Record(ONE, ONE, 1).decimate(2.5),
    "factor=20 leaves": lambda: fq.Record(ONE, ONE, 1).decimate(20),
    "leave no sample": lambda: fq.Record(ONE, ONE, 1).slice(5, 5),
    "std=-1": lambda: fq.Record(ONE, ONE, 1).with_noise(-1),
    "order=-1": lambda: fq.Record(ONE, ONE, 1).detrend(-1),
    "f1=900": lambda: fq.chirp(10, 900, 1, 1e-3),
    "method='cubic'": lambda: fq.chirp(10, 20, 1, 1e-3, method="cubic"),
    "frequency=600": lambda: fq.sine(600, 1, 1e-3),
    "u has 2 channels": lambda: fq.simulate(fq.first_order(), np.ones((5, 2)), 1),
    "initial_state has shape": lambda: fq.simulate(fq.first_order(), ONE, 1, initial_state=[1, 2]),
    "must have the period": lambda: fq.simulate(
        fq.first_order(), ONE, 1.0, hold=fq.ZeroOrderHold(2)
    ),
    "is not a model": lambda: fq.simulate("plant", ONE, 1.0),
}


@pytest.mark.parametrize("words", BAD_RECORDS)
def test_bad_input_is_named(words):
    with pytest.raises(ValueError, match=words):
        BAD_RECORDS[words]()


def test_records_are_scaled_and_subtracted_as_linear_plants_allow(plant):
    u = fq.white_noise(600, seed=4)
    first = fq.simulate(plant, u, 1e-3)
    second = fq.simulate(plant, np.roll(u, 7), 1e-3)
    for made in (2 * first, first * 2, first / 0.5, -(-2 * first)):
        np.testing.assert_allclose(made.y, fq.simulate(plant, 2 * u, 1e-3).y, atol=1e-9)
        assert made.hold == first.hold
    left = first - second
    again = fq.simulate(plant, u - np.roll(u, 7), 1e-3)
    np.testing.assert_allclose(left.y, again.y, atol=1e-9)
    np.testing.assert_allclose(left.u, again.u)
    assert sum([first, second]) == [first, second]
    for wrong in (lambda: first - second.decimate(2), lambda: first - second.slice(0, 0.3),
                  lambda: first - 3.0, lambda: first * "2", lambda: first * np.nan,
                  lambda: first / 0, lambda: first - second.with_conditions(q=1.0)):  # fmt: skip
        with pytest.raises(ValueError, match="record"):
            wrong()


def test_noise_by_ratio_for_each_output():
    record = fq.Record(np.arange(4000.0), np.random.default_rng(0).standard_normal((4000, 2)), 1.0)
    noise = (record.with_noise(snr=[40, 0], seed=1).y - record.y).std(axis=0)
    np.testing.assert_allclose(noise, [0.01, 1.0], rtol=0.05)
    with pytest.raises(ValueError, match="snr"):
        record.with_noise(snr=[1.0, 2.0, 3.0])


@pytest.mark.parametrize("named", [{}, {"inputs": "u", "outputs": "y"}, {"inputs": "u"}])
def test_a_frame_in_memory_keeps_reference_and_units(named):
    """The next fit of the loop would be a direct one, and biased."""
    u, y, r = (fq.white_noise(50, seed=k) for k in range(3))
    record = fq.Record(u, y, 0.01, reference=r, units={"y": "rad"})
    again = fq.Record.from_frame(record.to_frame(), **named)
    np.testing.assert_array_equal(again.reference, record.reference)
    assert again.units == record.units
    assert again.output_names == ("y",)
    # the frame is cut, as a user does
    part = fq.Record.from_frame(record.to_frame().iloc[10:], **named)
    np.testing.assert_array_equal(part.reference, record.reference[10:])


def test_a_column_that_is_a_channel_is_no_reference():
    record = fq.Record(*(fq.white_noise(50, seed=k) for k in (0, 1)), 0.01)
    frame = fq.Record(record.u, record.y, 0.01, reference=fq.white_noise(50, seed=2)).to_frame()
    assert fq.Record.from_frame(frame, "u", "reference").reference is None
    assert fq.Record.from_frame(frame, "reference", "y").reference is None
    frame.attrs["reference"] = ["of", "others"]
    assert fq.Record.from_frame(frame[["u", "y"]], "u", "y").reference is None
