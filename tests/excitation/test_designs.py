"""Designs: limits kept as a whole, a slow motion under them, and the file for a controller."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq

DT = 1e-3


@pytest.fixture
def wave():
    return fq.multisine((5, 60), 1.0, DT, crest="schroeder", n_inputs=1)


@pytest.mark.parametrize(
    ("amplitude", "slew"), [(3.0, None), (None, 50.0), (3.0, 50.0), (3.0, 1e9)]
)
def test_limits_are_just_kept(wave, amplitude, slew):
    design = fq.Design(wave, DT).within(amplitude, slew)
    steps = np.abs(np.diff(np.tile(design.u, 2))) / DT
    used = []
    if amplitude is not None:
        assert np.abs(design.u).max() <= amplitude * (1 + 1e-12)
        used.append(np.abs(design.u).max() / amplitude)
    if slew is not None:
        assert steps.max() <= slew * (1 + 1e-9)
        used.append(steps.max() / slew)
    assert max(used) == pytest.approx(1, rel=1e-9)
    # nothing but a factor: the same lines
    assert np.allclose(design.u / np.abs(design.u).max(), wave / np.abs(wave).max())


def test_orthogonal_designs_stay_so():
    u = fq.multisine((5, 60), 1.0, DT, 1, "random", n_inputs=3, orthogonal=True)
    design = fq.Design(u.reshape(-1, 3), DT).within(slew=80.0)
    assert design.slew == pytest.approx(80)
    U = np.fft.rfft(design.u.reshape(u.shape), axis=1)[:, 10]
    gram = U.conj().T @ U
    off = gram - np.diag(np.diag(gram))
    assert np.abs(off).max() < 1e-9 * np.abs(gram).max()


def test_an_axis_that_moves_never_stands_still(wave):
    two = np.column_stack([wave, np.roll(wave, 100)])
    design = fq.Design(0.2 * two / np.abs(two).max(), DT, ["q1", "q2"]).moving(1.0, 1.0)
    still = np.abs(design.u) < 0.2
    assert still.mean() < 0.2
    assert not np.allclose(design.u[:, 0], design.u[:, 1])
    # the lines of the multisine are as they were
    before, after = (np.fft.rfft(x, axis=0) for x in (0.2 * two / np.abs(two).max(), design.u))
    assert np.allclose(before[2:], after[2:], atol=1e-9)
    with pytest.raises(ValueError, match="multiple of 1 Hz"):
        design.moving(1.0, 0.7)


def test_the_file_is_what_is_sent(tmp_path, wave):
    design = fq.Design(np.column_stack([wave, -wave]), DT, ["m1", "m2"], {"m1": "N m"})
    design.to_csv(tmp_path / "sequence.csv")
    table = pd.read_csv(tmp_path / "sequence.csv", dtype=str)
    assert list(table.columns) == ["time [s]", "m1 [N m]", "m2"]
    assert np.array_equal(table[["m1 [N m]", "m2"]].to_numpy(str).astype(float), design.u)
    record = fq.read(tmp_path / "sequence.csv", inputs="m1", outputs="m2")
    assert record.dt == DT
    assert record.units == {"m1": "N m"}
    with pytest.raises(ValueError, match="csv"):
        design.to_csv(tmp_path / "sequence.txt")
    with pytest.raises(ValueError, match="units"):
        fq.Design(wave, DT, units={"x": "V"})
    with pytest.raises(ValueError, match="twice"):
        fq.Design(np.column_stack([wave, wave]), DT, ["a", "a"])
    with pytest.raises(ValueError, match="rename it"):
        fq.Design(wave, DT, ["time"]).to_csv(tmp_path / "b.csv")
    with pytest.raises(ValueError, match="Nyquist"):
        fq.Design(wave, DT).moving(1.0, 500.0)
