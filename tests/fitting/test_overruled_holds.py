"""A hold asked for in place of the one that a record remembers, where the data tell neither."""

import dataclasses

import numpy as np
import pytest
import scipy.signal

import freqid as fq

H, N = 1e-3, 8000
TRUE = {"b0": 900.0, "b1": 8.0, "a0": 900.0, "a1": 9.0}
BAND = (0.5, 20)
PLANT = fq.GreyBox(
    lambda b0, b1, a0, a1: ([[0, 1], [-a0, -a1]], [[0], [1]], [[b0, b1]], None),
    [fq.Parameter(n, v) for n, v in TRUE.items()],
)


def measured(seed, noise=0.2, h=H):
    """What a converter of a period of h drove, by scipy."""
    u = fq.chirp(0.5, 20, N * H, h)
    plant = [[0, 1], [-900, -9]], [[0], [1]], [[900, 8]], [[0]]
    ss = scipy.signal.cont2discrete([np.array(M, float) for M in plant], h)[:4]
    y = scipy.signal.dlsim((*ss, h), u)[1][:, 0]
    return u, y + noise * y.std() * np.random.default_rng(seed).standard_normal(len(u))


@pytest.mark.study
@pytest.mark.parametrize("model", [PLANT, fq.TransferFunction(1, 2)])
@pytest.mark.parametrize("seed", range(3))
def test_what_another_hold_does_unseen_is_said(model, seed):
    """These were trusted with b1 40 % too high, 8 standard errors."""
    record = fq.Record(*measured(seed), H).decimate(5)
    own = fq.fit(model, record, band=BAND)
    assert own.verdict.trusted
    est = fq.fit(model, record, band=BAND, hold="zoh")
    assert est.verdict.grade == "doubt"
    found = est.warnings[0]
    assert found.kind in ("hold overruled", "hold rejected")
    if found.kind == "hold overruled":
        shift = np.abs(own.values - est.values) / np.sqrt(np.diag(est.covariance_matrix))
        assert found.number == pytest.approx(shift.max(), rel=0.05)
        assert "ZeroOrderHold(period=0.001)" in found


def test_who_knows_better_than_what_is_usual_is_believed():
    u, y = measured(0)
    slow = fq.Record(u[::5], y[::5], 5 * H)
    est = fq.fit(PLANT, slow, band=BAND, hold=fq.ZeroOrderHold(H))
    assert est.verdict.trusted
    assert not any(w.kind == "hold overruled" for w in est.warnings)


def test_who_knows_better_than_the_record_is_believed_where_the_data_say_so():
    u, y = measured(0, noise=0.01)
    record = dataclasses.replace(fq.Record(u, y, H).decimate(5), hold=fq.FirstOrderHold(5 * H))
    est = fq.fit(PLANT, record, band=BAND, hold=fq.ZeroOrderHold(H))
    assert est.verdict.trusted


def test_a_hold_that_moves_nothing_is_no_matter():
    plant = fq.first_order(b=4.0, a=4.0)
    record = fq.simulate(plant, fq.chirp(0.1, 2, 20, 2e-3), 2e-3).with_noise(0.5, seed=1)
    assert fq.fit(plant, record.decimate(2), hold="zoh").verdict.trusted
