"""Dead times that look like something else: the other sign, one mode more."""

import dataclasses
import re

import numpy as np
import pytest

import freqid as fq
from tests.fitting.test_jumps import AXIS, DT


@pytest.mark.study
@pytest.mark.parametrize(("samples", "kind"), [(7, "chirp"), (10, "chirp"), (15, "noise")])
def test_a_dead_time_of_many_samples_is_named_with_its_size(samples, kind):
    """A mode half a turn late was told its outputs were of the opposite sign, or one mode more."""
    noise = np.random.default_rng(3).standard_normal(2000)
    record = fq.simulate(AXIS, fq.chirp(1, 40, 4, DT) if kind == "chirp" else noise, DT)
    y = np.concatenate([np.zeros(samples), record.y[:-samples]])
    late = fq.Record(record.u, y, DT).with_noise(0.02 * y.std(), seed=samples)
    est = fq.fit(AXIS, late)
    assert est.verdict.grade != "trust"
    assert est.warnings[0].kind == "delay"
    said = re.search(r"acts ([\d.]+) ms later", str(est.warnings[0]))
    assert float(said[1]) == pytest.approx(1e3 * samples * DT, abs=2.1e3 * DT)
    # the cure that it names
    cured = fq.fit(dataclasses.replace(AXIS, input_delay=samples * DT), late)
    assert cured.verdict.trusted
