"""Averaged spectra of records whose input is faster than their output."""

import numpy as np
import pytest

import freqid as fq

DT = 1e-3


def _mode(w, z, g):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [g]], [[1.0, 0]], None


MODE = fq.GreyBox(_mode, [fq.Parameter(n, v) for n, v in {"w": 60, "z": 0.1, "g": 3600}.items()])


@pytest.mark.parametrize("estimate", [fq.h1, fq.h2, fq.hv])
@pytest.mark.parametrize("keep_input", [True, False])
def test_what_slower_outputs_fold_of_the_input_is_told(estimate, keep_input):
    """Beside the whole input nothing was said: a gain of 740 ± 40 where 3600 is true, trusted."""
    record = fq.simulate(MODE, fq.white_noise(20000, seed=1), DT).with_noise(0.02, seed=2)
    slow = record.decimate(5, keep_input=keep_input)
    frf = estimate(slow, segment=800, band=(4, 50))
    assert frf.aliased == pytest.approx(0.8, abs=0.02)
    est = fq.fit(MODE, frf, weights="noise")
    assert not est.verdict.trusted
    assert any(w.kind == "aliased" for w in est.warnings)
    # an input that is slow enough folds nothing
    sweep = fq.simulate(MODE, fq.chirp(1, 50, 20, DT), DT).decimate(5, keep_input=keep_input)
    assert estimate(sweep, segment=800, band=(4, 50)).aliased < 1e-3


@pytest.mark.parametrize("estimate", [fq.h1, fq.h2, fq.hv])
def test_inputs_that_are_held_for_the_outputs_fold_nothing(estimate):
    """There the hold is what is wrong, and what is said."""
    held = np.repeat(fq.white_noise(4000, seed=3), 5)
    record = fq.simulate(MODE, held, DT).with_noise(0.02, seed=2).decimate(5, keep_input=True)
    frf = estimate(record, segment=800, band=(4, 50))
    assert frf.aliased == 0
    said = [w.kind for w in fq.fit(MODE, frf, weights="noise").warnings]
    assert "hold rejected" in said
    assert "aliased" not in said
