"""A stream where a record is expected says that its samples are not in memory, and the way."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq

RECORD = fq.simulate(fq.first_order(), fq.white_noise(4000), 0.5e-3)
STREAM = fq.open(np.column_stack([RECORD.u, RECORD.y]), dt=0.5e-3)


@pytest.mark.parametrize("name", ["u", "y", "time", "detrend", "with_noise", "to_frame"])
def test_what_a_record_has_is_named_with_the_way_to_it(name):
    with pytest.raises(AttributeError, match=rf"'{name}'.*load\(\)"):
        getattr(STREAM, name)


def test_what_nobody_has_is_a_plain_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'colour'"):
        _ = STREAM.colour


@pytest.mark.parametrize(
    "use",
    [
        lambda: STREAM["u"],
        lambda: fq.compare(fq.first_order(), STREAM),
        lambda: fq.residual_test(fq.first_order(), STREAM),
        lambda: fq.fit(fq.first_order(), [RECORD, STREAM]),
        lambda: fq.fit_many(fq.first_order(), [STREAM]),
        lambda: fq.plot_record(STREAM),
    ],
)
def test_calls_that_need_samples_name_load(use):
    with pytest.raises((ValueError, TypeError), match=r"load\(\)"):
        use()


def test_it_shows_itself_in_a_notebook():
    assert "4000 samples" in STREAM._repr_html_()


@pytest.mark.parametrize("kind", ["h5", "parquet"])
def test_a_sample_time_that_the_times_contradict_is_refused(tmp_path, kind):
    """dt=1 was taken in silence where ``read`` refuses it: every time constant 2000 times off."""
    path = tmp_path / f"log.{kind}"
    if kind == "h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            file["u"], file["y"], file["time"] = RECORD.u, RECORD.y, RECORD.time
    else:
        pytest.importorskip("pyarrow")
        pd.DataFrame({"time": RECORD.time, "u": RECORD.u, "y": RECORD.y}).to_parquet(path)
    with pytest.raises(ValueError, match=r"dt=1 s, but the time 'time'.*steps by 0.0005 s"):
        fq.open(path, inputs="u", outputs="y", dt=1.0)
    assert fq.open(path, inputs="u", outputs="y", dt=0.5e-3).dt == 0.5e-3


def test_beside_a_gap_a_sample_time_may_be_told(tmp_path):
    """Without one it is refused, and that told to give one, which was refused by the mean step."""
    pytest.importorskip("pyarrow")
    path = tmp_path / "gap.parquet"
    time = RECORD.time + np.where(np.arange(4000) < 1500, 0, 0.8)
    pd.DataFrame({"time": time, "u": RECORD.u, "y": RECORD.y}).to_parquet(path)
    with pytest.raises(ValueError, match="is not even"):
        fq.open(path, inputs="u", outputs="y")
    assert fq.open(path, inputs="u", outputs="y", dt=0.5e-3).dt == 0.5e-3
    with pytest.raises(ValueError, match="dt=1 s"):
        fq.open(path, inputs="u", outputs="y", dt=1.0)
