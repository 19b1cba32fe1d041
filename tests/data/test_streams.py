"""Streams: the same responses in one pass, whatever the blocks."""

import subprocess
import sys
import tracemalloc

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.checks import InputError
from freqid.fitting.cost import objective
from freqid.frf import one_pass

N, DT = 30_000, 1e-3
RECORD = fq.simulate(fq.two_mass(), fq.white_noise(N, seed=1), DT).with_noise(0.1)
ROWS = np.column_stack([RECORD.u, RECORD.y])


def files(folder):
    import pandas as pd

    np.save(folder / "log.npy", ROWS.astype(np.float32))
    fq.write(RECORD, folder / "log.parquet")
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "log.h5", "w") as file:
        file["run/u"], file["run/y"], file["time"] = RECORD.u, RECORD.y, RECORD.time
    assert len(pd.read_parquet(folder / "log.parquet")) == N
    return folder


@pytest.mark.parametrize("method", [fq.h1, fq.h2, fq.hv])
@pytest.mark.parametrize("block", [700, 4096, 100_000])
def test_blocks_change_nothing(method, block):
    whole = method(RECORD, 1000, band=(5, 200))
    stream = fq.open(ROWS, dt=DT, block=block)
    seen = method(stream, 1000, band=(5, 200))
    assert np.allclose(seen.response, whole.response, rtol=1e-9)
    assert np.allclose(seen.variance, whole.variance, rtol=1e-8)
    assert np.allclose(seen.coherence, whole.coherence, rtol=1e-9)
    # a second pass is another start
    assert np.array_equal(method(stream, 1000, band=(5, 200)).response, seen.response)


def test_files(tmp_path):
    files(tmp_path)
    whole = fq.h1(RECORD, 1000)
    for name, options in (("log.npy", {"dt": DT}), ("log.parquet", {}), ("log.h5", {})):
        stream = fq.open(tmp_path / name, block=5000, **options)
        assert stream.dt == pytest.approx(DT)
        assert stream.n_samples == N
        assert np.allclose(fq.h1(stream, 1000).response, whole.response, rtol=1e-5)
    assert np.allclose(fq.open(tmp_path / "log.h5").load().y, RECORD.y)
    assert fq.open(tmp_path / "log.h5").load(stop=100).n_samples == 100


def test_a_file_tells_its_hold_and_its_time(tmp_path):
    import pandas as pd

    fq.write(RECORD.with_hold("foh"), tmp_path / "log.parquet")
    assert fq.open(tmp_path / "log.parquet").hold == fq.FirstOrderHold(DT)
    frame = pd.DataFrame({"time": RECORD.time, "u": RECORD.u, "y": RECORD.y})
    dated = frame.assign(time=pd.Timestamp("2026-01-02") + pd.to_timedelta(frame["time"], "s"))
    dated.to_parquet(tmp_path / "dated.parquet")
    assert fq.open(tmp_path / "dated.parquet", "u", "y").dt == pytest.approx(DT)
    frame.drop(index=range(50, 900)).to_parquet(tmp_path / "gap.parquet")
    with pytest.raises(ValueError, match="is not even"):
        fq.open(tmp_path / "gap.parquet", "u", "y")
    frame.assign(time="noon").to_parquet(tmp_path / "noon.parquet")
    with pytest.raises(ValueError, match=r"noon\.parquet.*neither a number nor a time"):
        fq.open(tmp_path / "noon.parquet", "u", "y")


def test_generators_and_integers():
    def blocks():
        for start in range(0, N, 1234):
            yield np.round(1000 * ROWS[start : start + 1234]).astype(np.int32)

    stream = fq.open(blocks, dt=DT, scale=1e-3)
    assert np.allclose(fq.h1(stream, 500).response, fq.h1(RECORD, 500).response, rtol=0.02)
    with pytest.raises(ValueError, match="give segment"):
        fq.h1(stream)
    once = fq.open(blocks(), dt=DT)
    fq.h1(once, 500)
    with pytest.raises(ValueError, match="used up"):
        fq.h1(once, 500)


def test_dask_arrays():
    da = pytest.importorskip("dask.array")
    stream = fq.open(da.from_array(ROWS, chunks=(4000, 2)), dt=DT)
    assert np.allclose(fq.h1(stream, 500).response, fq.h1(RECORD, 500).response)


def test_from_a_stream_to_parameters():
    stream = fq.open(ROWS, dt=DT)
    plant = fq.two_mass()
    est = fq.fit(plant, fq.h1(stream, 5000, band=(5, 100)), weights="noise")
    assert est["k"] == pytest.approx(plant["k"], rel=0.02)
    est = fq.fit(plant, stream, band=(5, 100), weights="noise")
    assert est["k"] == pytest.approx(plant["k"], rel=0.02)
    with pytest.raises(ValueError, match="Stream is neither"):
        fq.compare(est, stream)


PASS = """
import sys
from pathlib import Path
import freqid as fq
stream = fq.open(sys.argv[1], dt=0.01).slice(stop=float(sys.argv[2]))
fq.h1(stream, 2000)
# that of getrusage begins with the parent's
told = Path("/proc/self/status").read_text().split()
print(int(told[told.index("VmHWM:") + 1]) / 1024)
"""


@pytest.mark.study
@pytest.mark.skipif(sys.platform != "linux", reason="counts and pages of its own")
@pytest.mark.parametrize("order", ["C", "F"])
def test_pages_of_a_file_that_were_read_are_given_back(tmp_path, order):
    path = tmp_path / "long.npy"
    rows = np.lib.format.open_memmap(path, "w+", np.float32, (20_000_000, 2), order == "F")
    some = np.random.default_rng(0).standard_normal((1_000_000, 2))
    for at in range(0, len(rows), len(some)):
        rows[at : at + len(some)] = some
    del rows
    few, every = (
        float(
            subprocess.run(
                [sys.executable, "-c", PASS, str(path), str(seconds)],
                capture_output=True, text=True, check=True,
            ).stdout
        )
        for seconds in (20_000, 200_000)
    )  # fmt: skip
    # 153 MiB are looked at, of which 15 in the shorter pass
    assert every - few < 25


def test_memory_is_bounded():
    """Two million samples of 32 MB that never are there at once."""
    count = 40

    def blocks():
        rng = np.random.default_rng(0)
        for _ in range(count):
            u = rng.standard_normal((50_000, 1))
            yield np.concatenate([u, 0.5 * u], axis=1)

    stream = fq.open(blocks, dt=DT)
    tracemalloc.start()
    frf = fq.h1(stream, 2000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.allclose(frf.response, 0.5)
    assert peak < 120e6


def test_what_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no sample time"):
        fq.open(ROWS)
    with pytest.raises(ValueError, match="inputs='v'"):
        fq.open(ROWS, inputs="v", dt=DT)
    for numbers in ({"inputs": 0}, {"inputs": [0], "outputs": [1]}):
        with pytest.raises(ValueError, match="by name"):
            fq.open(ROWS, dt=DT, **numbers)
    with pytest.raises(FileNotFoundError):
        fq.open(tmp_path / "none.npy")
    with pytest.raises(ValueError, match="shape"):
        fq.open(ROWS[:, 0], dt=DT)
    with pytest.raises(ValueError, match="longer than"):
        fq.h1(fq.open(ROWS[:100], dt=DT), 500)
    bad = ROWS.copy()
    bad[17_000, 1] = np.nan
    with pytest.raises(ValueError, match="sample 17000 is NaN"):
        fq.h1(fq.open(bad, dt=DT, block=5000), 500)
    with pytest.raises(ValueError, match=r"sample 300 has shape \(5, 3\)"):
        fq.h1(fq.open([ROWS[:300], np.zeros((5, 3))], dt=DT), 100)
    (tmp_path / "cut.npy").write_bytes(b"\x93NUMPY")
    with pytest.raises(ValueError, match=r"cut\.npy"):
        fq.open(tmp_path / "cut.npy", dt=DT)
    (tmp_path / "a.csv").write_text("1")
    with pytest.raises(ValueError, match=r"suffix='\.csv'"):
        fq.open(tmp_path / "a.csv")


def test_times_in_other_units_and_conditions(tmp_path):
    import pandas as pd

    at = {"time": np.round(1e3 * RECORD.time).astype(int), "u": RECORD.u, "y": RECORD.y}
    for name, stamps in {
        "t_ms": at["time"], "time [ms]": at["time"].astype(float),
        "time": 1_790_000_000_000_000_000 + 1_000_000 * at["time"],
    }.items():  # fmt: skip
        frame = pd.DataFrame({name: stamps, "u [N m]": RECORD.u, "y": RECORD.y})
        frame.to_parquet(tmp_path / "ms.parquet")
        stream = fq.open(tmp_path / "ms.parquet")
        assert stream.dt == pytest.approx(DT), name
        assert stream.input_names == ("u",)
        # as ``read`` does
        with pytest.raises(ValueError, match=rf"dt=1 s, but the time .* steps by {DT:g} s"):
            fq.open(tmp_path / "ms.parquet", dt=1.0)
    fq.write(RECORD.with_conditions(q=0.5), tmp_path / "q.parquet")
    stream = fq.open(tmp_path / "q.parquet")
    assert stream.conditions == {"q": 0.5}
    assert fq.h1(stream, 1000).conditions == {"q": 0.5}
    assert stream.load(100).conditions == {"q": 0.5}
    with pytest.raises(ValueError, match="stop"):
        stream.load(stop=1.5)
    with pytest.raises(ValueError, match="stream"):
        fq.etfe(stream)


PLANT = fq.two_mass()
START = {"k": 1.7e5, "Jm": 8e-4, "d": 13.0}


@pytest.mark.parametrize("kind", ["array", "generator", "log.h5", "log.parquet", "log.npy"])
def test_a_fit_in_one_pass_is_that_of_the_record(tmp_path, kind, monkeypatch):
    """As sixteen experiments or one: noise-free exactly the plant, whatever the block."""
    monkeypatch.setattr("freqid.frf.one_pass._SHORTEST", 1000)
    record = fq.simulate(PLANT, fq.chirp(5, 90, 20, 1e-3), 1e-3)
    rows = np.column_stack([record.u, record.y])
    passes = []

    def blocks():
        passes.append(1)
        yield from np.array_split(rows, 37)

    if kind == "log.npy":
        np.save(tmp_path / kind, rows)
    elif kind == "log.parquet":
        fq.write(record, tmp_path / kind)
    elif kind == "log.h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / kind, "w") as file:
            file["u"], file["y"], file["time"] = record.u, record.y, record.time
    options = {} if kind in ("log.h5", "log.parquet") else {"dt": 1e-3}
    source = {"array": rows, "generator": blocks}.get(kind, tmp_path / kind)
    est = fq.fit(PLANT, fq.open(source, **options), band=(5, 90), start=START)
    assert est.values == pytest.approx([PLANT[n] for n in est.names], rel=1e-7)
    assert len(est.data) >= 16
    assert len(passes) == (kind == "generator")
    assert "one pass" in est.notes[0]
    assert est.verdict.grade == "trust"


@pytest.mark.study
def test_its_error_bars_are_those_of_the_record(monkeypatch):
    monkeypatch.setattr("freqid.frf.one_pass._SHORTEST", 1000)
    plant = fq.first_order()
    inside = []
    for seed in range(12):
        record = fq.simulate(plant, fq.white_noise(16_000, seed=seed), 1e-3)
        noise = np.convolve(
            np.random.default_rng(seed).standard_normal(16_000), 0.5 ** np.arange(9)
        )
        rows = np.column_stack([record.u, record.y + 0.1 * noise[:16_000]])
        whole = fq.fit(plant, fq.Record(*rows.T, 1e-3), band=(1, 100), weights="noise")
        parts = fq.fit(plant, fq.open(rows, dt=1e-3), band=(1, 100), weights="noise")
        told = parts.parameters["std"] / whole.parameters["std"]
        assert told.to_numpy() == pytest.approx(1, rel=0.15)
        table = parts.parameters
        inside += list((table["lower"] < 100) & (table["upper"] > 100))
        assert (np.abs(parts.values - whole.values) < 0.8 * table["std"]).all()
    assert np.mean(inside) > 0.85


@pytest.mark.study
def test_a_fit_keeps_its_band_and_no_more():
    def blocks():
        rng = np.random.default_rng(0)
        last = 0.0
        for _ in range(64):
            u = np.repeat(rng.standard_normal(2500), 100)
            y = np.empty_like(u)
            pole = np.exp(-0.1)
            for i in range(0, len(u), 100):
                level = u[i]
                y[i : i + 100] = level + (last - level) * pole ** np.arange(100)
                last = level + (last - level) * pole**100
            yield np.column_stack([u, y])

    stream = fq.open(blocks, dt=1e-3)
    tracemalloc.start()
    est = fq.fit(fq.first_order(80, 130), stream, band=(0.1, 5), hold="zoh")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert est.values == pytest.approx([100, 100], rel=1e-6)
    # 16,000,000 samples of two channels are 244 MiB
    assert peak < 150 * 2**20


def test_a_fit_holds_its_lines_and_no_derivatives_of_all(monkeypatch):
    """Derivatives of all experiments at once were 400 bytes a line: 8.6 GiB for 1e9 samples."""
    monkeypatch.setattr(one_pass, "_SHORTEST", 1 << 15)
    monkeypatch.setattr(one_pass, "_LONGEST", 1 << 16)
    count = 1 << 21
    record = fq.simulate(fq.first_order(), fq.white_noise(count, seed=3), DT)
    rows = np.column_stack([record.u, record.y + 1e-3 * fq.white_noise(count, seed=4)])
    band = (1.0, 0.4 / DT)
    lines = (band[1] - band[0]) * count * DT
    tracemalloc.start()
    est = fq.fit(fq.first_order(80, 130), fq.open(rows, dt=DT), band=band, n_starts=1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert est.values == pytest.approx([100, 100], rel=1e-3)
    assert peak / lines < 190
    # in whatever portions they are folded
    monkeypatch.setattr(objective, "_HELD", 1)
    again = fq.fit(fq.first_order(80, 130), fq.open(rows, dt=DT), band=band, n_starts=1)
    np.testing.assert_allclose(again.values, est.values, rtol=1e-9)
    np.testing.assert_allclose(again.parameters["std"], est.parameters["std"], rtol=1e-9)


def test_streams_that_a_fit_cannot_take():
    plant = fq.first_order()
    with pytest.raises(ValueError, match="band"):
        fq.fit(plant, fq.open(ROWS, dt=DT), band=(5, 900))
    with pytest.raises(ValueError, match="no samples"):
        fq.fit(plant, fq.open(lambda: iter([]), dt=DT))

    def broken():
        yield ROWS[:100]
        yield np.full((5, 2), np.nan)

    with pytest.raises(ValueError, match="sample 100 is NaN"):
        fq.fit(plant, fq.open(broken, dt=DT))


@pytest.mark.study
def test_what_a_stream_is_asked_afterwards(monkeypatch, tmp_path):
    """Turned channels, holds of their own, weights: as the record has them."""
    monkeypatch.setattr("freqid.frf.one_pass._SHORTEST", 1000)
    record = fq.simulate(PLANT, fq.white_noise(20_000, seed=2), 5e-4).with_noise(0.5, seed=1)
    stream = fq.open(np.column_stack([record.u, record.y]), dt=5e-4)
    for options in ({"hold": "foh"}, {"weights": "noise"}, {}):
        whole = fq.fit(PLANT, record, band=(10, 80), **options)
        parts = fq.fit(PLANT, stream, band=(10, 80), **options)
        assert parts.verdict.grade == whole.verdict.grade
        assert parts.cost / parts.n_rows == pytest.approx(whole.cost / whole.n_rows, rel=0.1)
        assert len(parts.suspects)
        assert parts.dt == whole.dt
    parts.report(tmp_path / "est.html")
    parts.save(tmp_path / "est.json")
    assert fq.load(tmp_path / "est.json")["k"] == parts["k"]
    for name, value in (
        ("hold", "estimate"), ("separate", ["fm"]), ("initial_state", "zero"), ("domain", "time"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=name):
            fq.fit(PLANT, stream, band=(10, 80), **{name: value})


def test_channels_of_a_stream_turn_with_their_holds(monkeypatch):
    monkeypatch.setattr("freqid.frf.one_pass._SHORTEST", 1000)

    def driven(a, b, c):
        return [[-a, 0], [1, 0]], [[b, c], [0, 0]], np.eye(2), np.zeros((2, 2))

    model = fq.GreyBox(
        driven, [fq.Parameter(n, v) for n, v in (("a", 20.0), ("b", 50.0), ("c", 10.0))],
        inputs=["f", "g"], outputs=["vel", "pos"],
    )  # fmt: skip
    u = np.random.default_rng(0).standard_normal((20_000, 2))
    names = {"input_names": ["f", "g"], "output_names": ["vel", "pos"]}
    holds = {"f": "foh", "g": "zoh"}
    record = fq.simulate(model, u, 1e-3, hold=holds, **names)
    rows = np.column_stack([record["pos"], record["g"], record["vel"], record["f"]])
    stream = fq.open(
        rows, ["g", "f"], ["pos", "vel"], 1e-3, holds, columns=["pos", "g", "vel", "f"]
    )
    est = fq.fit(model, stream, band=(2, 30), start={"a": 25.0})
    assert est.values == pytest.approx([20, 50, 10], rel=1e-8)
    assert fq.fit(fq.TransferFunction(1, 2), stream, band=(2, 30)).fit_percent > 99.9
    assert fq.fit(fq.OutputError(2), stream, band=(2, 30)).fit_percent > 95


def test_a_damaged_file_is_named_wherever_it_is_noticed(tmp_path):
    """numpy's own error of a header, pyarrow's of a page, and no name of the file."""
    record = fq.Record(np.sin(np.arange(60)), np.cos(np.arange(60)), 0.01)
    np.save(tmp_path / "log.npy", np.column_stack([record.u, record.y]))
    content = (tmp_path / "log.npy").read_bytes()
    (tmp_path / "log.npy").write_bytes(content.replace(b"}", b"("))
    with pytest.raises(InputError, match=r"log\.npy: is not NPY or is damaged"):
        fq.open(tmp_path / "log.npy", dt=0.01)
    pytest.importorskip("pyarrow")
    fq.write(record, tmp_path / "log.parquet")
    with pytest.raises(InputError, match=r"log\.parquet: outputs='z' is not one of"):
        fq.open(tmp_path / "log.parquet", "u", "z")
    content = bytearray((tmp_path / "log.parquet").read_bytes())
    refusals = []
    for at in range(20, 700, 7):
        changed = bytearray(content)
        changed[at] ^= 0xFF
        (tmp_path / "log.parquet").write_bytes(changed)
        try:
            fq.h1(fq.open(tmp_path / "log.parquet", "u", "y"), segment=20)
        except InputError as error:
            refusals.append(str(error))
    assert len(refusals) > 10
    assert all("log.parquet" in text for text in refusals)


def test_samples_whose_squares_are_beyond_numbers_are_told():
    """It was a warning of numpy, and a response that is no number."""
    u, y = np.random.default_rng(0).standard_normal((2, 200))
    y[7] = 1e200
    with pytest.raises(InputError, match=r"records: squares of the samples are beyond numbers"):
        fq.h1(fq.Record(u, y, 0.01), segment=20)
    with pytest.raises(InputError, match=r"ndarray: squares of the samples are beyond numbers"):
        fq.h1(fq.open(np.column_stack([u, y]), dt=0.01), segment=20)


def test_a_table_in_memory_and_a_channel_at_both_ends_are_no_stream():
    table = pd.DataFrame({"u": np.arange(50.0), "y": np.arange(50.0)})
    with pytest.raises(ValueError, match=r"source is a DataFrame.*Record\.from_frame"):
        fq.open(table, dt=0.1)
    with pytest.raises(ValueError, match="inputs and outputs share u"):
        fq.open(table.to_numpy(), "u", ["u", "y"], dt=0.1)


def loop_and_slow_output(folder):
    u = fq.white_noise(4000, seed=1)
    record = fq.simulate(fq.first_order(), u, 1e-3)
    fq.write(fq.Record(record.u, record.y, 1e-3, reference=u), folder / "loop.parquet")
    fq.write(record.decimate(10, keep_input=True), folder / "slow.parquet")


def test_what_a_stream_has_not_is_not_left_out_in_silence(tmp_path):
    """A loop that was opened without its reference came out at -289 where 100 was true."""
    loop_and_slow_output(tmp_path)
    with pytest.raises(ValueError, match=r"loop\.parquet keeps a reference.*read\(\) it"):
        fq.open(tmp_path / "loop.parquet")
    assert fq.open(tmp_path / "loop.parquet", "u", "y").n_samples == 4000
    with pytest.raises(ValueError, match=r"'y' is blank in half of its rows .* read\(\)"):
        fq.open(tmp_path / "slow.parquet")
    assert fq.read(tmp_path / "slow.parquet").factor == 10


@pytest.mark.parametrize("whole", [False, True])
def test_chunks_that_a_folder_lacks_are_said(tmp_path, whole):
    zarr = pytest.importorskip("zarr")
    record = fq.simulate(fq.first_order(), fq.white_noise(4000, seed=1), 1e-3)
    if whole:
        both = np.column_stack([record.u, record.y])
        array = zarr.create_array(
            tmp_path / "log.zarr", shape=both.shape, dtype=both.dtype, chunks=(1000, 2)
        )
        array[:] = both
        lost = tmp_path / "log.zarr/c/1/0"
    else:
        group = zarr.open_group(tmp_path / "log.zarr", mode="w")
        for name, samples in (("u", record.u), ("y", record.y)):
            group.create_array(name, shape=samples.shape, dtype=samples.dtype, chunks=(1000,))[
                :
            ] = samples
        lost = tmp_path / "log.zarr/y/c/1"
    fq.open(tmp_path / "log.zarr", "u", "y", dt=1e-3)
    lost.unlink()
    with pytest.warns(UserWarning, match=r"has 3 of 4 chunks, the rest is 0: .* cut off"):
        fq.open(tmp_path / "log.zarr", "u", "y", dt=1e-3)
