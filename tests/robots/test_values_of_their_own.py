"""Experiments that met plants of their own, in whatever uses the estimate afterwards."""

import dataclasses

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT = 5e-3
LOADS, DAMPINGS = (0.0, 0.5, 1.0), (2.0, 3.0, 6.0)


def cart():
    def matrices(m, d, k, load):
        M = m + load
        return [[0, 1], [-k / M, -d / M]], [[0], [1 / M]], [[0, 1]], None

    parameters = [fq.Parameter("m", 1.5), fq.Parameter("d", 1.0), fq.Parameter("k", 300.0)]
    return fq.GreyBox(matrices, parameters, conditions={"load": 0.0})


def records(noise=2e-3, seed=0):
    made = []
    for i, (load, d) in enumerate(zip(LOADS, DAMPINGS, strict=True)):
        true = cart().with_values(m=1, d=d, k=400).with_conditions(load=load)
        u = fq.white_noise(1200, seed=10 * seed + i)
        made.append(fq.simulate(true, u, DT).with_noise(noise, seed=10 * seed + i))
    return made


@pytest.mark.parametrize(
    "options", [{}, {"weights": "noise"}, {"loss": "huber"}, {"domain": "time"}]
)
def test_each_way_to_fit_finds_them(options):
    est = fq.fit(cart(), records(), separate=["d"], **options)
    for i, d in enumerate(DAMPINGS):
        assert est[f"d[{i}]"] == pytest.approx(d, abs=5 * est.parameters["std"][f"d[{i}]"])
        assert est.parameters["std"][f"d[{i}]"] < 0.05 * d
    assert est["k"] == pytest.approx(400, rel=2e-3)


def test_a_condition_that_one_record_does_not_say_is_noted():
    data = records()
    silent = dataclasses.replace(data[1], conditions={})
    est = fq.fit(cart(), [data[0], silent])
    assert any("data[1] do not say it" in note for note in est.notes), est.notes


def test_a_comparison_is_with_the_plant_that_the_record_met(tmp_path):
    data = records()
    est = fq.fit(cart(), data, separate="d")
    for record in data:
        assert fq.compare(est, record).fit_percent[0] > 85
        assert fq.residual_test(est, record)["passed"].all()
    assert any("d[0]" in note for note in est.notes)
    est.save(tmp_path / "carts.json")
    kept = fq.load(tmp_path / "carts.json", model=cart())
    for record in data:
        assert fq.compare(kept, record).fit_percent == fq.compare(est, record).fit_percent
    other = records(seed=1)[2]
    with pytest.raises(ValueError, match=r"d has a value for each.*with_conditions\(d=\.\.\.\)"):
        fq.compare(est, other)
    assert fq.compare(est, other.with_conditions(d=6.0)).fit_percent[0] > 85
    assert fq.compare(est, other.with_conditions(d=2.0)).fit_percent[0] < 70


def test_what_has_no_values_of_their_own():
    data = records()
    est = fq.fit(cart(), data, separate="d")
    with pytest.raises(ValueError, match="separate"):
        fq.bootstrap(cart(), data, n=4, separate="d")
    with pytest.raises(ValueError, match="separate"):
        fq.cross_validate(cart(), data, separate="d")
    with pytest.raises(ValueError, match="for itself"):
        fq.hold_bias(est, data)


def test_responses_are_not_averaged_over_conditions():
    for estimator in (fq.h1, fq.local_rational, fq.etfe):
        with pytest.raises(ValueError, match="different plants"):
            estimator(records()[:2])


def loops(noise=0.01):
    """Two loads under one controller, which correlates the input with the noise."""
    rng, made = np.random.default_rng(3), []
    for load in LOADS[:2]:
        true = cart().with_values(m=1, d=2, k=400).with_conditions(load=load)
        A, B, C, _, _ = scipy.signal.cont2discrete(true.state_space(), DT)
        r = 5 * fq.white_noise(3000, seed=int(10 * load))
        x, u, y = np.zeros(2), np.zeros(3000), np.zeros(3000)
        disturbance = noise * rng.standard_normal(3000)
        for k in range(3000):
            y[k] = (C @ x)[0] + disturbance[k]
            u[k] = r[k] - 20 * y[k]
            x = A @ x + B[:, 0] * u[k]
        record = fq.Record(u, y, DT, reference=r)
        made.append(record.with_conditions(load=load))
    return made


def test_closed_loops_at_two_loads_are_two_loops():
    est = fq.fit(cart(), loops(), start={"m": 1.2, "d": 1.5, "k": 350})
    for name, value in (("m", 1), ("d", 2), ("k", 400)):
        assert est[name] == pytest.approx(value, abs=4.5 * est.parameters["std"][name])
    assert sum("reference" in note for note in est.notes) >= 2


def test_an_experiment_that_knows_a_value_keeps_its_row():
    model = fq.first_order()
    u = fq.chirp(2, 40, 2, 1e-3)
    records = [fq.simulate(model.with_values(a=a), u, 1e-3) for a in (90.0, 120.0, 140.0)]
    records[1] = records[1].with_conditions(a=120.0)
    own = fq.fit(model, records, separate=["a"]).separate
    assert list(own.index) == [0, 1, 2]
    assert own["a"].isna().tolist() == [False, True, False]
    assert own["a"][2] == pytest.approx(140, rel=1e-5)


def test_what_conditions_tell_of_every_record_is_nobodys_own():
    plant = fq.first_order(b=40.0, a=40.0)
    record = fq.simulate(plant, fq.white_noise(500), 2e-3).with_noise(0.01)
    told = record.with_conditions(a=40.0)
    with pytest.raises(ValueError, match="separate='a' is known for each data set"):
        fq.fit(plant, [told, told], separate="a")
    est = fq.fit(plant, [told, record], separate="a")
    assert "a[1]" in est.names
    assert not [n for n in est.notes if "a[0]" in n]
