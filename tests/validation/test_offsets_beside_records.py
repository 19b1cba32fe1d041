"""A fit whose offsets were free, beside the records that it and others were logged with."""

import numpy as np
import pytest

import freqid as fq

HEATED = fq.first_order(b=0.8 / 60, a=1 / 60)


def stepped(seed, level=95.0, n=800):
    """From rest at 30 %, at a level of its own in degrees, of which the model knows nothing."""
    u = np.r_[np.full(n // 4, 30.0), np.full(n - n // 4, 50.0)]
    clean = fq.simulate(HEATED, u - 30, 1.0)
    return fq.Record(u, level + clean.y, 1.0).with_noise(0.2, seed=seed)


@pytest.mark.parametrize("loaded", [False, True])
def test_offsets_that_were_free_are_free_beside_a_record(loaded, tmp_path):
    """Trusted with 99.96 % explained, and beside the same record -2.6 %: low by the offset."""
    record = stepped(1)
    est = fq.fit(HEATED, record, offset="estimate")
    assert est.verdict.trusted
    if loaded:
        est.save(tmp_path / "heated.json")
        est = fq.load(tmp_path / "heated.json")
    for data in (record, stepped(2, level=40.0)):
        # what noise of 0.2 leaves
        wanted = 100 * (1 - 0.2 / np.std(data.y))
        assert fq.compare(est, data).fit_percent[0] == pytest.approx(wanted, abs=0.5)
        assert fq.residual_test(est, data)["passed"].all()


def test_offsets_that_were_not_are_seen():
    est = fq.fit(HEATED, stepped(1), offset="estimate")
    known = HEATED.with_values(**est.parameters["value"].to_dict())
    assert fq.compare(known, stepped(1)).fit_percent[0] < 50
