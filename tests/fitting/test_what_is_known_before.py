"""Priors that the data contradict, and starts of what no search moves."""

import numpy as np
import pytest
from scipy import signal

import freqid as fq
from tests.fitting.test_smooth_inputs import lag, measured


@pytest.fixture(scope="module")
def record():
    u = fq.chirp(2, 40, 4, 5e-3)
    return fq.simulate(fq.first_order(), u, 5e-3).with_noise(0.02, seed=3)


@pytest.mark.parametrize("away", [-40.0, 6.0])
def test_a_prior_that_the_data_contradict_is_said(record, away):
    plant = fq.first_order()
    alone = fq.fit(plant, record)
    std = float(alone.parameters.loc["a", "std"])
    est = fq.fit(plant.with_prior(a=(alone["a"] + away * std, 0.1 * std)), record)
    said = [w for w in est.warnings if w.kind == "prior contradicted"]
    assert len(said) == 1
    assert "a=" in said[0]
    assert said[0].number == pytest.approx(abs(away) / np.sqrt(1.01), rel=0.1)
    assert est.verdict.grade != "trust"


def test_right_priors_are_seldom_contradicted(record):
    """Of priors whose means scatter as they say, narrow and wide, none is far off."""
    rng, plant = np.random.default_rng(0), fq.first_order()
    alone = fq.fit(plant, record)
    truth, std = plant["a"], float(alone.parameters.loc["a", "std"])
    for width in (0.3, 1.0, 10.0):
        for _ in range(8):
            prior = truth + width * std * rng.standard_normal(), width * std
            est = fq.fit(plant.with_prior(a=prior), record)
            assert not [w for w in est.warnings if w.kind == "prior contradicted"]


def test_a_start_of_a_fixed_parameter_is_refused_unless_it_is_its_value(record):
    plant = fq.first_order().fix("b")
    with pytest.raises(ValueError, match=r"start: b=7.* is fixed at .*with_values\(b="):
        fq.fit(plant, record, start={"b": 7.0})
    est = fq.fit(plant, record, start={"b": plant["b"], "a": 1.2 * plant["a"]})
    assert list(est.names) == ["a"]
    with pytest.raises(ValueError, match=r"start='c' is not one of"):
        fq.fit(plant, record, start={"c": 7.0})


@pytest.mark.study
def test_a_hold_that_the_record_contradicts_is_no_loop():
    """The paper's experiment: what a wrong hold leaves looks like a loop, too."""
    fast, slow = fq.paper.study_records()
    for record in (slow, fast.decimate(10)):
        for hold in ("foh", "bl"):
            est = fq.fit(fq.two_mass(), record, hold=hold, band=(10, 80))
            kinds = [w.kind for w in est.warnings]
            assert kinds[0] == "hold rejected"
            assert "feedback" not in kinds
            assert est.verdict.grade == "do not use"


def test_a_spike_at_the_end_of_a_decimated_record_says_where_it_comes_from():
    """How a chirp begins is folded by decimation; with its input kept the record is trusted."""
    fast = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 5, 5e-4), 5e-4).with_noise(0.05, seed=0)
    est = fq.fit(fq.two_mass(), fast.decimate(10), band=(10, 80))
    spikes = [w for w in est.warnings if w.kind == "spikes"]
    assert len(spikes) == 1
    assert "at 0 s, an end of a decimated record: decimate(n, keep_input=True)" in spikes[0]
    kept = fq.fit(fq.two_mass(), fast.decimate(10, keep_input=True), band=(10, 80))
    assert kept.verdict.grade == "trust"


@pytest.mark.study
@pytest.mark.parametrize("weights", [None, "noise"])
def test_honest_priors_in_coloured_noise_are_believed_for_what_they_are(weights):
    """A lag in AR(0.9) noise: white noise of its size would tell the gain ten times as well."""
    model, true, std = lag(), np.array([3.0, 0.1]), 0.06
    contradicted, errors, off = 0, [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.standard_normal(30), 20)
        clean = measured(model, u, 0.01, 0.0, 0).outputs[:, 0]
        noise = signal.lfilter([1], [1, -0.9], rng.standard_normal(800))[200:]
        record = fq.Record(u, clean + 0.3 * np.std(clean) * noise / np.std(noise), 0.01)
        known = model.with_prior(K=(3.0 + std * rng.standard_normal(), std))
        est = fq.fit(known, record, weights=weights, n_starts=1)
        contradicted += any("contradicted" in r for r in est.verdict.reasons)
        errors.append((est.values - true) / np.sqrt(np.diag(est.covariance_matrix)))
        off.append((est["K"] - 3.0) / std)
    assert contradicted <= 1
    assert np.sqrt(np.mean(np.square(errors))) < 1.5
    # no worse than the prior alone, whose own errors are of size one
    assert np.sqrt(np.mean(np.square(off))) < 1.4
