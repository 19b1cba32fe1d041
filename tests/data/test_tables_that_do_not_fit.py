"""Tables, streams and records that do not fit: each is refused in words that name what is wrong."""

import re

import numpy as np
import pandas as pd
import pytest

import freqid as fq

T = np.linspace(0, 1, 30)
UNEVEN = T + 0.01 * np.sin(40 * T)
RECORD = fq.simulate(fq.first_order(), fq.white_noise(60), 0.01)
LONG = "frequency,output,input,real,imag,input_spectrum"


def lines(*rows):
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("time,u,y\n", {}, "no samples"),
        (lines("time,t,u,y", *(f"{k},{k},1,2" for k in range(4))), {"time": "t"},
         "time='t': the column 'time' is another"),
        (lines("t,u,y", *(f"{k},1,2" for k in range(4))), {"time": "clock"}, "time='clock'.*'t'"),
        (lines("t,u,v,y", *(f"{k},1,2,3" for k in range(4))), {"inputs": "u"},
         r"outputs=None: name them; the other columns are \['v', 'y'\]"),
        (lines("t,u,v,y", *(f"{k},1,2,3" for k in range(4))), {"outputs": "y"}, "inputs=None"),
        (lines("time,u,y", *(f"{t:.9f},1,2" for t in UNEVEN)), {}, "is not uniform"),
        (lines("time,u,y", *(f"{k},,2" for k in range(9))), {"resample": True},
         "column 'u' has no samples at all"),
    ],
    ids=["empty", "two times", "no such time", "outputs", "inputs", "uneven", "nothing there"],
)  # fmt: skip
def test_texts(text, options, words, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        fq.read(path, **options)


def test_what_is_for_text_tables_alone(tmp_path):
    path = tmp_path / "log.parquet"
    RECORD.to_frame().to_parquet(path)
    for option in ({"sep": ";"}, {"decimal": ","}):
        with pytest.raises(ValueError, match=r"log\.parquet: (sep|decimal)= is for text tables"):
            fq.read(path, **option)
    with pytest.raises(ValueError, match="group= is for"):
        fq.read(path, group="run")


def test_a_binary_file_of_no_known_kind(tmp_path):
    path = tmp_path / "log.xyz"
    path.write_bytes(bytes(range(1, 9)) * 40)
    with pytest.raises(ValueError, match=r"log\.xyz: \.xyz is of no kind that is read"):
        fq.read(path)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("f,mag,phase\n1,2,3\n2,3,4\n", {"columns": ["f", "re"]}, "columns names 2 .* has 3"),
        (lines(LONG, "1,y,a,1,0,1", "2,y,a,1,0,1", "1,y,b,1,0,1", "2,z,a,1,0,1"), {}, "has 1 rows"),
        (lines("f,mag,phase", "1,2,3", "1,2,3"), {}, "holds a frequency twice"),
    ],
    ids=["columns", "rows", "twice"],
)
def test_responses(text, options, words, tmp_path):
    path = tmp_path / "frf.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        fq.read_response(path, **options)


def test_a_response_where_a_record_is_read(tmp_path):
    """A table that freqid wrote itself, and one with complex numbers in a column."""
    frf = fq.etfe(RECORD)
    frf.to_frame().to_csv(tmp_path / "own.csv", index=False)
    with pytest.raises(ValueError, match=r"own\.csv.*read_response"):
        fq.read(tmp_path / "own.csv")
    np.savez(tmp_path / "complex.npz", frequency=frf.frequency, G=frf.response[0, 0])
    with pytest.raises(ValueError, match=r"complex\.npz.*read_response"):
        fq.read(tmp_path / "complex.npz")
    (tmp_path / "plant.s1p").write_text("# Hz S RI R 50\n1 0.5 0\n2 0.4 0.1\n")
    with pytest.raises(ValueError, match=r"plant\.s1p.*read_response"):
        fq.read(tmp_path / "plant.s1p")


ROWS = np.column_stack([RECORD.u, RECORD.y, RECORD.y])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"scale": {"channel2": 0.0}, "inputs": "channel1"}, "scale=0 leaves .* 'channel2'"),
        ({"scale": 0, "inputs": "channel1"}, "scale=0 leaves nothing of"),
        ({}, "inputs=None, outputs=None: name them; the channels are"),
    ],
    ids=["a scale", "all scales", "three channels"],
)
def test_streams_opened_of_arrays(options, words):
    with pytest.raises(ValueError, match=words):
        fq.open(ROWS, dt=0.01, **options)


def test_streams_of_named_channels(tmp_path):
    table = pd.DataFrame({"u": RECORD.u, "y": RECORD.y, "temperature": 20.0})
    table.to_parquet(tmp_path / "log.parquet")
    # the two that are called so, whatever else is there
    stream = fq.open(tmp_path / "log.parquet", dt=RECORD.dt)
    assert (stream.input_names, stream.output_names) == (("u",), ("y",))
    np.testing.assert_array_equal(stream.load().y, RECORD.y)
    named = fq.open(tmp_path / "log.parquet", outputs=["y", "temperature"], dt=RECORD.dt)
    assert named.input_names == ("u",)
    with pytest.raises(ValueError, match="inputs and outputs need a channel each"):
        fq.open(tmp_path / "log.parquet", inputs=["u", "y", "temperature"], dt=RECORD.dt)


def test_a_band_that_was_not_kept():
    long = fq.simulate(fq.first_order(), fq.white_noise(40_000), 0.001)
    stream = fq.open(np.column_stack([long.u, long.y]), dt=long.dt)
    est = fq.fit(fq.first_order(), stream, band=(5, 40))
    (part, *_) = est.data
    inside = fq.etfe(part, (10, 20))
    assert ((inside.frequency >= 10) & (inside.frequency <= 20)).all()
    assert len(inside.frequency) > 50
    with pytest.raises(ValueError, match=r"reaches beyond .*which was kept"):
        fq.etfe(part, (5, 80))
    assert part.select("u", "y").input_names == part.input_names


def test_differences_of_unlike_records():
    loop = fq.Record(RECORD.u, RECORD.y, 0.01, reference=RECORD.u)
    with pytest.raises(ValueError, match="one of the records has a reference"):
        loop - RECORD
    t = np.cumsum(0.01 + 0.002 * np.random.default_rng(1).random(60))
    stamped = fq.Record.from_logs(t, RECORD.u, t + 1e-3 * np.sin(9 * t), RECORD.y)
    with pytest.raises(ValueError, match=r"clocks of their own .* record\.regular\(\)"):
        stamped - stamped


def test_a_record_in_a_notebook():
    told = RECORD.with_conditions(load=2.5)._repr_html_()
    assert "load" in told
    assert "2.5" in told
    assert "conditions" not in RECORD._repr_html_()


def test_one_input_more_is_one():
    with pytest.raises(ValueError, match=r"shape \(60, 2\); expected one input, \(N,\)"):
        RECORD.with_input("v", np.ones((60, 2)))


def test_periodic_responses_of_numbers():
    fields = {
        "frequency": [1.0], "response": [1.0], "inputs": [[[1.0]]], "outputs": [[[1.0]]],
        "noise": [[np.eye(2)]], "freedom": 3,
    }  # fmt: skip
    assert fq.PeriodicResponse(**fields).freedom == 3
    for name in ("inputs", "outputs", "noise"):
        odd = np.array(fields[name], complex)
        odd.flat[0] = np.nan
        with pytest.raises(ValueError, match=f"{name} must be finite"):
            fq.PeriodicResponse(**{**fields, name: odd})


def test_stamps_as_durations_and_as_words():
    t = pd.to_timedelta(0.01 * np.arange(60), unit="s")
    record = fq.Record.from_logs(t.to_numpy(), RECORD.u, t.to_numpy(), RECORD.y)
    assert record.dt == pytest.approx(0.01)
    assert any("durations" in note for note in record.notes)
    with pytest.raises(ValueError, match="u_time must be three finite times"):
        fq.Record.from_logs(np.array(["a"] * 60, dtype="U1"), RECORD.u, 0.01 * T, RECORD.y)


def test_a_long_gap_says_how_to_read_what_lies_around_it(tmp_path):
    """It recommended straight lines through 200 samples, which moved all that was fitted."""
    t = np.delete(np.arange(2000) * 1e-3, np.arange(700, 900))
    path = tmp_path / "gap.csv"
    u = np.sin(np.arange(len(t)) ** 1.5)
    rows = zip(t, u, np.cumsum(u), strict=True)
    path.write_text("time,u,y\n" + "".join(f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in rows))
    with pytest.raises(ValueError, match="200 samples are missing") as said:
        fq.read(path)
    before, after = (float(re.search(rf"read\({w}=([\d.]+)\)", str(said.value))[1])
                     for w in ("stop", "start"))  # fmt: skip
    assert (before, after) == (0.7, 0.9)
    assert fq.read(path, stop=before).n_samples == 700
    assert fq.read(path, start=after).n_samples == 1100
