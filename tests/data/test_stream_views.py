"""Views of streams, and what a source may do to the numbers: beside the record in memory."""

import dataclasses
import os

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.data.stream_views import low_pass_taps

N, DT = 20_000, 1e-3
RNG = np.random.default_rng(3)
X = RNG.standard_normal((N, 3))
NAMES = ["u", "y", "z"]
RECORD = fq.Record(X[:, 0], X[:, 1:], DT, output_names=["y", "z"])


def stream(block=777, rows=X, **options):
    options = {"columns": NAMES, "dt": DT} | options
    return fq.open(rows, "u", options.pop("outputs", ["y", "z"]), block=block, **options)


@pytest.mark.parametrize("block", [1, 777, 4096, N])
@pytest.mark.parametrize(
    "view",
    [
        lambda r: r.slice(1.5, 9.25),
        lambda r: r.slice(3),
        lambda r: r.slice(stop=2.5),
        lambda r: r.decimate(7),
        lambda r: r.slice(0.003, 11).decimate(5).slice(2, 8).decimate(3),
        lambda r: r.select(outputs="z"),
        lambda r: r.decimate(4).select(outputs=["z", "y"]).slice(1, 3),
        lambda r: r.with_hold("foh").decimate(3),
        lambda r: r.with_conditions(q=1.5).slice(1, 2),
    ],
)
def test_views_are_those_of_the_record(view, block):
    if block == 1:
        seen, held = view(stream(1, X[:12_000])), view(RECORD.slice(stop=12))
    else:
        seen, held = view(stream(block)), view(RECORD)
    loaded = seen.load()
    assert np.array_equal(loaded.u, held.u)
    assert np.array_equal(loaded.y, held.y)
    assert seen.n_samples == held.n_samples
    assert (loaded.dt, loaded.hold, loaded.output_names) == (held.dt, held.hold, held.output_names)
    assert dict(loaded.conditions) == dict(held.conditions)


@pytest.mark.study
def test_a_pass_from_the_middle_is_the_rest():
    for seen in (
        stream(),
        stream().decimate(7),
        stream().slice(1, 15),
        stream().decimate(6, antialias=True),
    ):
        whole = np.concatenate(list(seen.checked()))
        for first in (0, 1, 500, 777, 1500):
            rest = np.concatenate([np.zeros((0, 3)), *seen.checked(first)])
            assert rest == pytest.approx(whole[first:], abs=1e-12)


def test_the_filter_is_the_convolution_and_does_what_is_said():
    for factor in (2, 5, 16):
        taps = low_pass_taps(factor)
        f, H = scipy.signal.freqz(taps, worN=np.linspace(0, np.pi, 40_001))
        new = np.pi / factor
        assert np.abs(np.abs(H[f <= 0.9 * new]) - 1).max() < 2e-5
        assert np.abs(H[f >= new]).max() < 2e-5
        by_hand = np.column_stack([np.convolve(x, taps, "same")[::factor] for x in X.T])
        for block in (50, 3000, N):
            seen = stream(block).decimate(factor, antialias=True).load()
            assert np.column_stack([seen.u, seen.y]) == pytest.approx(by_hand, abs=1e-10)


def test_filtering_leaves_the_relation_alone():
    plant = fq.two_mass()
    record = fq.simulate(plant, fq.chirp(1, 60, 20, DT), DT)
    rows = np.column_stack([record.u, record.y])
    thinned = fq.open(rows, dt=DT).decimate(5, antialias=True).load()
    est = fq.fit(plant, thinned, band=(5, 60), hold=fq.ZeroOrderHold(DT))
    assert est.values == pytest.approx([plant[n] for n in est.names], rel=2e-3)


def test_the_band_of_a_stream_is_used_where_none_is_asked_for():
    plant = fq.first_order()
    record = fq.simulate(plant, fq.white_noise(N, seed=1), DT).with_noise(0.1)
    seen = fq.open(np.column_stack([record.u, record.y]), dt=DT)
    kept = seen.with_band((2, 40))
    assert np.array_equal(fq.h1(kept, 1000).response, fq.h1(seen, 1000, band=(2, 40)).response)
    assert np.array_equal(
        fq.h1(kept, 1000, band=(5, 20)).response, fq.h1(seen, 1000, band=(5, 20)).response
    )
    est = fq.fit(plant, kept)
    assert est.values.tolist() == fq.fit(plant, seen, band=(2, 40)).values.tolist()
    assert est.band == (2, 40)
    with pytest.raises(ValueError, match="Nyquist"):
        seen.with_band((2, 900))


def test_what_views_refuse():
    with pytest.raises(ValueError, match="leave no sample"):
        stream().slice(30)
    with pytest.raises(ValueError, match="leaves 1 of 20000"):
        stream().decimate(20_000)
    with pytest.raises(ValueError, match="has one rate"):
        stream().decimate(4, keep_input=True)
    with pytest.raises(ValueError, match="factor"):
        stream().decimate(1.5)
    with pytest.raises(ValueError, match="outputs='w'"):
        stream().select(outputs="w")


def test_a_source_that_fills_the_same_memory_again():
    def blocks():
        rows = np.empty((1000, 2))
        for at in range(0, N, 1000):
            rows[:] = X[at : at + 1000, :2]
            yield rows

    seen = fq.open(blocks, dt=DT)
    assert np.array_equal(seen.load().y, X[:, 1])
    parts = [np.column_stack([u, y]).copy() for u, y in seen.stretches(4321)]
    assert np.array_equal(np.concatenate(parts), X[:, :2])


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (X[:, :2] + 1j, "complex128; expected real"),
        (X[:, :2].astype(str), "expected real numbers"),
        (np.array([[None, "a"]], dtype=object), "expected real numbers"),
        (X[:5], r"shape \(5, 3\); expected \(n, 2\)"),
        (np.float64(3), r"shape \(\)"),
        (np.ma.masked_greater(X[:50, :2], 1), "masked"),
        (np.ones((5, 2), np.int16), "int16, others before it floating"),
    ],
)
def test_blocks_that_are_none(rows, told):
    seen = fq.open(lambda: iter([X[:300, :2], rows]), dt=DT)
    for ask in (lambda: fq.h1(seen, 100), seen.load, lambda: fq.fit(fq.first_order(), seen)):
        with pytest.raises(ValueError, match=f"the block at sample 300.*{told}"):
            ask()


def test_whatever_a_source_raises_is_said_with_its_place():
    def blocks():
        yield X[:300, :2]
        raise OSError("the line went dead")

    seen = fq.open(blocks, dt=DT)
    with pytest.raises(ValueError, match="stopped at sample 300: OSError: the line went dead"):
        seen.load()
    bad = X[:, :2].copy()
    bad[9_000, 1] = np.nan
    with pytest.raises(ValueError, match="sample 9000 is NaN"):
        fq.open(bad, dt=DT).slice(3).decimate(6).load()
    # what is beside it can be had
    assert fq.open(bad, dt=DT).slice(stop=9).load().n_samples == 9000


def test_each_channel_has_its_scale():
    counts = np.round(1000 * X).astype(np.int16)
    for scale in ([2.0, 0.5, 0.25], {"u": 2.0, "y": 0.5, "z": 0.25}):
        seen = stream(rows=counts, scale=scale).load()
        assert np.array_equal(seen.u, 2.0 * counts[:, 0])
        assert np.array_equal(seen.y, counts[:, 1:] * [0.5, 0.25])
    with pytest.raises(ValueError, match="scale='v'"):
        stream(rows=counts, scale={"v": 1.0})
    with pytest.raises(ValueError, match="scale has 2 values"):
        stream(rows=counts, scale=[1.0, 2.0])


def test_a_dask_array_of_unknown_length_is_told():
    da = pytest.importorskip("dask.array")
    array = da.from_array(X[:, :2], chunks=(500, 2))
    with pytest.raises(ValueError, match="compute_chunk_sizes"):
        fq.open(array[array[:, 0] > 0], dt=DT)


def test_zarr(tmp_path):
    zarr = pytest.importorskip("zarr")
    array = zarr.create_array(tmp_path / "a.zarr", shape=(N, 3), chunks=(900, 3), dtype="f4")
    array[:] = X
    seen = fq.open(tmp_path / "a.zarr", "u", ["y", "z"], DT, columns=NAMES, block=5000)
    assert np.array_equal(seen.load().y, X[:, 1:].astype("f4").astype(float))
    group = zarr.open_group(tmp_path / "g.zarr", mode="w")
    run = group.create_group("run")
    for name, values in (("u", X[:, 0]), ("y", X[:, 1])):
        run.create_array(name, shape=(N,), chunks=(1000,), dtype="f8")[:] = values
    group.create_array("dt", shape=(1,), dtype="f8")[:] = DT
    seen = fq.open(tmp_path / "g.zarr")
    assert (seen.dt, seen.input_names, seen.output_names) == (DT, ("u",), ("y",))
    assert np.array_equal(seen.slice(4, 9).load().y, X[4000:9000, 1])
    assert np.allclose(fq.h1(seen, 500).response, fq.h1(RECORD.select(outputs="y"), 500).response)
    with pytest.raises(FileNotFoundError):
        fq.open(tmp_path / "none.zarr", dt=DT)
    (tmp_path / "bad.zarr").mkdir()
    with pytest.raises(ValueError, match=r"bad\.zarr"):
        fq.open(tmp_path / "bad.zarr", dt=DT)


def hdf5(path, **arrays):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name.replace("__", "/")] = values
    return path


def test_hdf5_matrices_groups_and_lengths(tmp_path):
    path = hdf5(tmp_path / "m.h5", log=X, dt=DT)
    seen = fq.open(path, "log1", ["log2", "log3"])
    assert np.array_equal(seen.load().y, X[:, 1:])
    # as ``read`` names them
    assert fq.read(path, "log1", ["log2", "log3"]).output_names == seen.output_names
    assert fq.open(path, "u", "z", columns=NAMES).load().y == pytest.approx(X[:, 2])
    two = {"a__u": X[:, 0], "a__y": X[:, 1], "b__u": X[:500, 1], "b__y": X[:500, 2], "dt": DT}
    path = hdf5(tmp_path / "g.h5", **two)
    assert np.array_equal(fq.open(path, group="b").load().y, X[:500, 2])
    with pytest.raises(ValueError, match="group='c'"):
        fq.open(path, group="c")
    path = hdf5(tmp_path / "short.h5", u=X[:, 0], v=X[:, 1], y=X[:-5, 1], dt=DT)
    with pytest.raises(ValueError, match="u 20000, v 20000, y 19995"):
        fq.open(path)
    with pytest.raises(ValueError, match="u 20000, y 19995"):
        fq.open(path, "u", "y")
    assert fq.open(path, "u", "v").n_samples == N
    path = hdf5(tmp_path / "count.h5", u=X[:, 0], y=X[:, 1], counter=np.arange(N + 1), dt=DT)
    assert np.array_equal(fq.open(path, "u", "y").load().y, X[:, 1])


def test_the_sample_time_is_the_nearest_that_is_told(tmp_path):
    """Rates and attributes as ``read`` takes them, each group's its own."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, rate in (("a", 500.0), ("b", 100.0)):
            group = file.create_group(name)
            group["u"], group["y"] = X[:, 0], X[:, 1]
            group.attrs["fs"] = rate
        file["info/dt"] = 7.0
    path = tmp_path / "a.h5"
    assert fq.open(path, group="a").dt == pytest.approx(1 / 500)
    assert fq.open(path, group="b").dt == pytest.approx(1 / 100)
    assert fq.read(path, group="b").dt == pytest.approx(1 / 100)
    assert fq.open(path, "b/u", "b/y").dt == pytest.approx(1 / 100)
    with pytest.raises(ValueError, match=r"sample times of 0\.002, 0\.01 s"):
        fq.open(path, "a/u", "b/y")
    assert fq.open(path, "a/u", "b/y", dt=0.5).dt == 0.5
    with h5py.File(tmp_path / "t.h5", "w") as file:
        for name, step in (("a", 0.1), ("b", 0.2)):
            for channel, values in (("u", X[:, 0]), ("y", X[:, 1]), ("time", step * np.arange(N))):
                file[f"{name}/{channel}"] = values
    assert fq.open(tmp_path / "t.h5", "b/u", "b/y").dt == pytest.approx(0.2)
    zarr = pytest.importorskip("zarr")
    array = zarr.create_array(tmp_path / "a.zarr", shape=(9, 2), dtype="f8")
    array[:] = X[:9, :2]
    array.attrs["fs"] = 50.0
    assert fq.open(tmp_path / "a.zarr").dt == pytest.approx(0.02)
    root = zarr.open_group(tmp_path / "g.zarr", mode="w")
    for name in ("u", "y"):
        root.create_array(f"run/{name}", shape=(9,), dtype="f8")[:] = 1.0
    root["run"].attrs["dt"] = 0.25
    assert fq.open(tmp_path / "g.zarr").dt == 0.25


def test_chunks_that_take_more_memory_than_they_may(tmp_path):
    zarr = pytest.importorskip("zarr")
    h5py = pytest.importorskip("h5py")
    size = 10**9
    zarr.create_array(tmp_path / "b.zarr", shape=(size, 2), chunks=(size, 2), dtype="f8")
    group = zarr.open_group(tmp_path / "g.zarr", mode="w")
    for name in ("u", "y"):
        group.create_array(name, shape=(size,), chunks=(size,), dtype="f8")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        for name in ("u", "y"):
            file.create_dataset(
                name, shape=(size,), chunks=(10**8,), dtype="f8", compression="gzip"
            )
    for name in ("b.zarr", "g.zarr", "b.h5"):
        with pytest.raises(ValueError, match=rf"{name[0]}\.\w+: a chunk of .* FREQID_READ_LIMIT"):
            fq.open(tmp_path / name, dt=DT)


def test_pickles_in_a_zarr_array_are_not_run(tmp_path):
    """numcodecs knows pickles, which could run anything, as filters of arrays of version 2."""
    import json
    import pickle

    zarr = pytest.importorskip("zarr")
    ran = tmp_path / "ran"

    class Runs:
        def __reduce__(self):
            return os.mkdir, (str(ran),)

    codec = {"id": "pickle", "protocol": 5}
    delta = {"id": "delta", "dtype": "<f8"}
    for change in ({"filters": [codec]}, {"compressor": codec}, {"filters": [delta, codec]}):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.zarr"
        zarr.create_array(
            path, shape=(9, 2), chunks=(9, 2), dtype="f8", zarr_format=2, compressors=None
        )[:] = 1.0
        told = json.loads((path / ".zarray").read_text()) | change
        (path / ".zarray").write_text(json.dumps(told))
        (path / "0.0").write_bytes(pickle.dumps(Runs()))
        with pytest.raises(ValueError, match=path.name):
            fq.open(path, dt=DT).load()
    assert not ran.exists()


def test_names_for_a_file_are_taken(tmp_path):
    np.save(tmp_path / "yu.npy", X[:, 1::-1])
    seen = fq.open(tmp_path / "yu.npy", "u", "y", DT, columns=["y", "u"]).load()
    assert np.array_equal(seen.u, X[:, 0])
    fq.write(RECORD, tmp_path / "r.parquet")
    with pytest.raises(ValueError, match="columns"):
        fq.open(tmp_path / "r.parquet", columns=["a", "b", "c"])
    with pytest.raises(ValueError, match="group"):
        fq.open(tmp_path / "r.parquet", group="a")


def test_a_file_that_ends_early(tmp_path):
    np.save(tmp_path / "log.npy", X[:, :2])
    path = tmp_path / "log.npy"
    path.write_bytes(path.read_bytes()[: -1000 * 16 - 7])
    seen = fq.open(path, dt=DT)
    with pytest.raises(ValueError, match="ends after 18999 of 20000 samples"):
        seen.load()
    assert np.array_equal(seen.slice(stop=18).load().y, X[:18_000, 1])


def test_parquet_with_a_last_row_of_its_own_and_other_columns(tmp_path):
    import pandas as pd

    frame = pd.DataFrame({"t": np.arange(2001) * DT, "u": X[:2001, 0], "y": X[:2001, 1]})
    frame["when"] = pd.Timestamp("2026-01-02") + pd.to_timedelta(frame["t"], "s")
    frame["what"] = "run"
    frame.to_parquet(tmp_path / "one.parquet", row_group_size=1000)
    seen = fq.open(tmp_path / "one.parquet", "u", "y", dt=DT)
    assert np.array_equal(seen.load().y, X[:2001, 1])
    plain = frame[["t", "u", "y"]]
    plain.to_parquet(tmp_path / "two.parquet", row_group_size=1000)
    assert fq.open(tmp_path / "two.parquet").dt == pytest.approx(DT)
    # turned
    assert np.array_equal(fq.open(tmp_path / "two.parquet", "y", "u").load().u, X[:2001, 1])


@pytest.mark.parametrize("kind", ["h5", "parquet", "zarr"])
def test_units_stay_with_their_channels(kind, tmp_path):
    record = fq.Record(RECORD.u, RECORD.y[:, 0], DT, units={"u": "N m", "y": "rad/s"})
    path = tmp_path / f"log.{kind}"
    if kind == "parquet":
        fq.write(record, path)
    else:
        library = pytest.importorskip({"h5": "h5py"}.get(kind, kind))
        file = library.File(path, "w") if kind == "h5" else library.open_group(path, mode="w")
        for name, x, unit in (("u", record.u, "N m"), ("y", record.y, "rad/s"), ("v", 0, "")):
            made = file.create_dataset if kind == "h5" else file.create_array
            made(name, data=np.ascontiguousarray(x * np.ones(len(record.u))))
            file[name].attrs["units"] = unit
        if kind == "h5":
            file.close()
    stream = fq.open(path, "u", "y", dt=record.dt)
    assert dict(stream.units) == record.units
    assert stream.load().units == record.units
    assert fq.h1(stream, 200).unit() == fq.h1(record, 200).unit() == "(rad/s)/(N m)"
    assert fq.fit(fq.first_order(), stream, band=(2, 20)).data[0].units == record.units
    assert stream.select("u", "y").slice(0, 1).decimate(2).load().units == record.units


def test_units_of_older_programs(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, x, unit in zip("uy", (RECORD.u, RECORD.y[:, 0]), (b"\xb5V", "°C"), strict=True):
            file[name] = x
            file[name].attrs["units"] = unit
    units = {"u": "µV", "y": "°C"}
    record = fq.read(tmp_path / "log.h5", "u", "y", dt=DT)
    stream = fq.open(tmp_path / "log.h5", "u", "y", dt=DT)
    assert record.units == units == dict(stream.units)
    fq.h1(stream, 500).to_frame().to_csv(tmp_path / "frf.csv")
    assert fq.read_response(tmp_path / "frf.csv").units == units


def test_a_column_of_a_matrix_and_a_channel_of_its_name(tmp_path):
    """The second column of x is called as another channel is, whose samples were never taken."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["x"], file["x1"] = X[:, :2], X[:, 2]
    with pytest.raises(ValueError, match=r"log\.h5: \['x1'\] are the names of two channels"):
        fq.open(tmp_path / "log.h5", "x1", "x2", dt=DT)


def rough(n=40000):
    """A low-passed noise of which a quarter lies above an eighth of the sample rate."""
    rng = np.random.default_rng(5)
    u = scipy.signal.lfilter([0.3], [1, -0.7], rng.standard_normal(n))
    y = scipy.signal.lfilter([0.1, 0.05], [1, -1.6, 0.8], u) + 0.1 * rng.standard_normal(n)
    return fq.Record(u, y, 1e-3)


@pytest.mark.parametrize("block", [700, 8192, 100000])
def test_what_decimation_folds_is_remembered_as_a_record_does(block):
    record = rough()
    stream = fq.open(np.column_stack([record.u, record.y]), dt=1e-3, block=block).decimate(4)
    kept = record.decimate(4)
    assert stream.load().aliased == pytest.approx(kept.aliased, rel=0.05)
    for made in (fq.h1(stream, 500), fq.h1(kept, 500), fq.etfe(kept), fq.local_polynomial(kept)):
        assert made.aliased == pytest.approx(kept.aliased, rel=0.05)
    for data in (stream, fq.h1(stream, 500)):
        est = fq.fit(fq.first_order(), data, band=(2.0, 60.0))
        assert "aliased" in [w.kind for w in est.warnings]
    clean = fq.open(np.column_stack([record.u, record.y]), dt=1e-3).decimate(4, antialias=True)
    assert clean.load().aliased < 1e-4
    assert fq.open(np.column_stack([record.u, record.y]), dt=1e-3).load().aliased == 0


def test_slow_drifts_hide_no_folding_and_make_none():
    """Each window takes its own mean; a record's is that of all."""
    t = np.arange(60000) * 1e-3
    slow = np.sin(2 * np.pi * 0.02 * t)
    record = fq.Record(slow + 0.01 * np.random.default_rng(0).standard_normal(len(t)), slow, 1e-3)
    stream = fq.open(np.column_stack([record.u, record.y]), dt=1e-3).decimate(10).load()
    assert stream.aliased == pytest.approx(record.decimate(10).aliased, rel=0.5)


def test_a_second_pass_begins_where_no_sample_came_before():
    """The end of a ramp before its beginning is a jump, which no window may hold."""
    t = np.arange(10000) * 1e-3
    ramp = fq.open(np.column_stack([t, t]), dt=1e-3).decimate(4)
    assert [ramp.load().aliased < 1e-12 for _ in range(4)] == [True] * 4


def test_of_several_records_and_of_periods_it_is_the_most():
    slow = rough().decimate(4)
    clean = fq.Record(slow.u, slow.y, slow.dt, hold=slow.hold)
    assert clean.aliased == 0
    for made in (fq.h1([clean, slow], 500), fq.etfe([clean, slow]),
                 fq.local_polynomial([clean, slow])):  # fmt: skip
        assert made.aliased == slow.aliased
    repeated = fq.Record(np.tile(slow.u[:1000], 4), np.tile(slow.y[:1000], 4), slow.dt)
    periods = fq.periodic([repeated, dataclasses.replace(repeated, aliased=0.3)], 1000 * slow.dt)
    assert periods.aliased == 0.3
    assert fq.Record.from_frame(slow.to_frame()).aliased == slow.aliased


def test_files_remember_it_for_streams_and_responses(tmp_path):
    kept = rough().decimate(4)
    fq.write(kept, tmp_path / "a.parquet")
    stream = fq.open(tmp_path / "a.parquet", "u", "y")
    assert stream.aliased == kept.aliased == stream.load().aliased
    frf = fq.h1(stream, 500)
    frf.to_frame().to_csv(tmp_path / "frf.csv", index=False)
    assert fq.read_response(tmp_path / "frf.csv").aliased == kept.aliased
    assert frf.select((2.0, 60.0)).aliased == kept.aliased
