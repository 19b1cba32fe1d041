"""The hold's period from the data, and holds that the data reject."""

import numpy as np
import pytest

import freqid as fq

BAND = (10, 80)


def test_the_papers_decimated_record_tells_its_hold(plant, slow, relative_error):
    est = fq.fit(plant, slow, hold="estimate", band=BAND)
    assert est.hold_period == pytest.approx(0.5e-3, rel=2e-3)
    assert max(abs(est[n] / plant[n] - 1) for n in ("Jm", "k", "Ja", "fm", "d")) < 5e-3
    assert est.parameters.loc["hold_period", "unit"] == "s"
    assert any("probably decimated by about 10" in w for w in est.warnings)


@pytest.mark.study
def test_its_interval_holds_the_truth(plant, slow):
    std, inside, runs = 0.01 * slow.y.std(), 0, 60
    for seed in range(runs):
        est = fq.fit(plant, slow.with_noise(std, seed=seed), hold="estimate", band=BAND)
        row = est.parameters.loc["hold_period"]
        inside += row["lower"] <= 0.5e-3 <= row["upper"]
    # 60 runs of a fair 95 % interval have fewer than 51 hits once in ten thousand
    assert inside >= 51


def test_a_record_that_was_never_decimated_gets_no_such_warning(plant, rng):
    record = fq.simulate(plant, rng.standard_normal(4000), 5e-3).with_noise(0.1)
    est = fq.fit(plant, record, hold="estimate")
    assert est.hold_period == pytest.approx(5e-3, rel=0.02)
    assert not any("decimated" in w for w in est.warnings)


def test_the_derivative_by_the_period(plant, slow):
    from freqid.fitting.cost.nuisance import HoldPeriod
    from freqid.fitting.cost.objective import Objective
    from freqid.fitting.cost.structures import GreyStructure
    from freqid.fitting.reading import Reading

    experiment = Reading.of(slow, "zoh", BAND).lines()
    structure = GreyStructure(plant, unknown=[HoldPeriod.of(slow.dt)])
    objective = Objective(structure, [experiment])
    x = np.array([1.1, 0.9, 1.05, 1.2, 0.8, 0.3])
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        ends = [objective.point(x + s * step).cost for s in (1, -1)]
        point = objective.point(x)
        gradient = 2 * point.jacobian[:, k] @ point.residual
        assert gradient == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)


@pytest.mark.study
@pytest.mark.parametrize("hold", ["zoh", "foh", "bl"])
def test_a_hold_that_the_data_contradict_is_rejected(plant, slow, hold):
    est = fq.fit(plant, slow.with_noise(0.1), hold=hold, band=BAND)
    assert any("hold rejected" in w for w in est.warnings)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_hold_that_is_right_is_not_rejected(plant, slow, hold):
    record = fq.simulate(plant, slow.u, 5e-3, hold=hold).with_noise(0.1)
    est = fq.fit(plant, record, hold=hold, band=BAND)
    assert est.warnings == []


def test_what_cannot_tell_a_hold_is_named(plant, fast):
    with pytest.raises(ValueError, match="kept at its own rate"):
        fq.fit(plant, fast.decimate(10, keep_input=True), hold="estimate")
    with pytest.raises(ValueError, match="domain='frequency'"):
        fq.fit(plant, fast, hold="estimate", domain="time")
    with pytest.raises(ValueError, match="needs a GreyBox"):
        fq.fit(fq.OutputError(3), fast, hold="estimate")


def test_everything_an_estimate_offers_with_an_estimated_hold(plant, slow, tmp_path):
    est = fq.fit(plant, slow.with_noise(0.3, seed=4), hold="estimate", band=(10, 80))
    frf = est.frequency_response(2 * np.pi * np.array([20.0, 40.0]))
    assert (frf.variance > 0).all()
    linear, profile = est.intervals(), est.intervals("profile")
    assert profile.index.tolist()[-1] == "hold_period"
    half = (linear["upper"] - linear["lower"]) / 2
    assert ((profile - linear).abs().max(axis=1) < 0.3 * half).all()
    est.report(tmp_path / "est.html")
    assert fq.compare(est, slow).fit_percent[0] > 95
    fq.plot_poles(est)


def test_what_an_estimated_hold_mends_is_no_doubt():
    """Right estimates of decimated chirps had been doubted for having been decimated, 10 of 10."""
    plant, trusted = fq.two_mass(), 0
    clean = fq.simulate(plant, fq.chirp(10, 80, 10, 0.5e-3), 0.5e-3)
    for seed in range(4):
        slow = clean.with_noise(0.03 * clean.y.std(), seed=seed).decimate(10)
        # a file knows nothing of how it came to be
        est = fq.fit(plant, fq.Record(slow.u, slow.y, slow.dt), hold="estimate")
        assert any("decimated by about 10" in w for w in est.warnings)
        trusted += est.verdict.grade == "trust"
    assert trusted >= 3


def test_a_hold_that_the_data_leave_open_is_not_said_to_be_none():
    """ "The input is band-limited" of a hold of 0 ± 8 s at 2 ms: a direct term takes it up."""
    lead = fq.GreyBox(
        lambda g, z, p: ([[-p]], [[1.0]], [[g * (z - p)]], [[g]]),
        [fq.Parameter("g", 3.0), fq.Parameter("z", 5.0), fq.Parameter("p", 40.0)],
    )
    said = []
    for seed in range(4):
        record = fq.simulate(lead, fq.chirp(0.5, 20, 8, 1e-3), 1e-3)
        record = record.with_noise(0.02 * float(record.y.std()), seed=seed).decimate(2)
        est = fq.fit(lead, record, band=(0.5, 20), hold="estimate", start={"z": 6.0, "p": 30.0})
        open_ended = est.hold.period < 0.02 * record.dt
        said += [w.kind for w in est.warnings] if open_ended else []
    assert "no hold" not in said
    assert "not identifiable" in said
