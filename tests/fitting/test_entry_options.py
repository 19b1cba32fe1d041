"""reference=, offset=, loss= and progress= of fit: each cures what it is for, and says so."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT = 0.01
LAG = fq.first_order(b=50.0, a=20.0)


def coloured(seed, size, pole):
    e = np.random.default_rng(seed).standard_normal(size + 500)
    return scipy.signal.lfilter([np.sqrt(1 - pole**2)], [1, -pole], e)[500:]


def in_a_loop(seed, size=4000, feedback=3.0, level=1.5):
    """A lag under u(k) = r(k) − K y(k), with slow noise on its output."""
    r = np.random.default_rng(seed).standard_normal(size)
    v = level * coloured(seed + 50, size, 0.95)
    phi = np.exp(-20 * DT)
    gamma = 2.5 * (1 - phi)
    x, u, y = 0.0, np.zeros(size), np.zeros(size)
    for k in range(size):
        y[k] = x + v[k]
        u[k] = r[k] - feedback * y[k] / 3
        x = phi * x + gamma * u[k]
    return fq.Record(u, y, DT, reference=r)


@pytest.mark.study
def test_a_record_with_a_reference_is_fitted_through_it():
    poles, through, inside = [], [], []
    for seed in range(12):
        record = in_a_loop(seed)
        est = fq.fit(LAG, record)
        assert "through the reference" in est.notes[0]
        row = est.parameters.loc["b"]
        through.append(est["b"])
        inside.append(row["lower"] <= 50 <= row["upper"])
        poles.append(fq.fit(LAG, record, reference=False)["a"])
    assert abs(np.median(through) - 50) < 3
    # a direct fit is drawn towards the inverse of the controller, or to a pole that explains noise
    assert np.abs(np.array(poles) - 20).min() > 8
    assert sum(inside) >= 9


def test_a_direct_fit_in_a_loop_says_so():
    est = fq.fit(LAG, in_a_loop(3), reference=False)
    assert not est.notes
    assert any(w.kind == "feedback" for w in est.warnings)
    assert est.verdict.grade == "do not use"


def test_a_loop_without_noise_needs_no_detour():
    est = fq.fit(LAG, in_a_loop(1, level=0.0))
    assert "fitted as it is" in est.notes[0]
    assert est["a"] == pytest.approx(20, rel=1e-6)
    forced = fq.fit(LAG, in_a_loop(1, level=0.0), reference=True)
    assert "through the reference" in forced.notes[0]
    assert forced["a"] == pytest.approx(20, rel=1e-6)


@pytest.mark.study
def test_little_noise_in_a_loop_is_heard_in_the_input_and_left_where_it_does_no_harm():
    """Of 0.8 % the loop brings back what biases a direct fit by 0.6 standard errors, of 0.1 % by
    nothing that shows.
    """
    for level, through in ((0.02, True), (0.003, False)):
        off = []
        for seed in range(8):
            est = fq.fit(LAG, in_a_loop(seed, level=level))
            heard = "goes together with what the reference leaves" in est.notes[0]
            assert heard == through
            off.append((est["a"] - 20) / est.parameters.loc["a", "std"])
        assert np.sqrt(np.mean(np.square(off))) < 2


def test_a_reference_that_comes_too_late_is_none():
    """It was fitted through all the same, with a thousand times the error bar."""
    u = fq.white_noise(1500, seed=4)
    record = fq.simulate(LAG, u, DT).with_noise(0.02, seed=5)
    est = fq.fit(LAG, fq.Record(u, record.y, DT, reference=np.r_[np.zeros(3), u[:-3]]))
    assert "too late" in est.notes[0]
    assert est["a"] == pytest.approx(20, rel=0.02)
    assert est.verdict.trusted


def test_noise_of_the_input_sensor_is_no_bias_where_there_is_a_reference():
    off = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        r = fq.white_noise(1500, seed=seed)
        y = fq.simulate(LAG, r, DT).with_noise(0.01, seed=seed).y
        u = r + 0.05 * rng.standard_normal(1500)
        est = fq.fit(LAG, fq.Record(u, y, DT, reference=r))
        assert "measured with noise" in est.notes[0]
        off.append((est["b"] - 50) / est.parameters.loc["b", "std"])
    assert np.sqrt(np.mean(np.square(off))) < 2


@pytest.mark.parametrize("options", [{"domain": "time"}, {"initial_state": "zero"}])
def test_records_with_a_reference_are_fitted_in_time_too(options):
    """Their way through it was given weights, which samples in time have not."""
    rng = np.random.default_rng(3)
    r = scipy.signal.lfilter([0.3], [1, -0.7], fq.white_noise(1500, seed=3))
    y = fq.simulate(LAG, r, DT).with_noise(0.01, seed=3).y
    record = fq.Record(r + 0.02 * r.std() * rng.standard_normal(1500), y, DT, reference=r)
    for reference in ("auto", True):
        est = fq.fit(LAG, record, reference=reference, **options)
        assert est["a"] == pytest.approx(20, rel=0.05)


@pytest.mark.study
def test_an_actuator_that_adds_noise_of_its_own_is_no_loop():
    """What its reference does not explain of an input excites, where it is measured."""
    said = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        r = fq.white_noise(1200, seed=seed)
        u = r + 0.03 * scipy.signal.lfilter([1], [1, -0.8], rng.standard_normal(1200))
        y = fq.simulate(LAG, u, DT).y
        y = y + 0.05 * scipy.signal.lfilter([1], [1, -0.9], rng.standard_normal(1200))
        est = fq.fit(LAG, fq.Record(u, y, DT, reference=r))
        said += "fitted as it is" not in est.notes[0]
    assert said == 0


def test_without_a_reference_none_can_be_asked_for():
    record = fq.simulate(LAG, fq.white_noise(500), DT)
    with pytest.raises(ValueError, match="reference=True, but a record has none"):
        fq.fit(LAG, record, reference=True)
    with pytest.raises(ValueError, match="reference"):
        fq.fit(LAG, record, reference="always")


@pytest.mark.parametrize("model", [LAG, fq.OutputError(1), fq.TransferFunction(0, 1)])
def test_an_offset_is_an_unknown(model):
    clean = fq.simulate(LAG, fq.white_noise(800, seed=1) + 0.3, DT)
    shifted = fq.Record(clean.u, clean.y + 0.5, DT).slice(1, 7)
    est = fq.fit(model, shifted, offset="estimate")
    pole = est.modes()["frequency"][0] * 2 * np.pi
    assert pole == pytest.approx(20, rel=1e-7)
    assert "0.5" in est.notes[0]
    wrong = fq.fit(model, shifted.with_noise(0.05))
    assert abs(wrong.modes()["frequency"][0] * 2 * np.pi - 20) > 0.1


@pytest.mark.study
def test_the_offset_of_each_record_and_its_error_bars():
    hits = []
    for seed in range(60):
        records = []
        for i, size in enumerate((0.5, -2.0)):
            clean = fq.simulate(LAG, fq.white_noise(300, seed=10 * seed + i) + 0.5, DT)
            records.append(fq.Record(clean.u, clean.y + size, DT).with_noise(0.1, seed=seed + i))
        est = fq.fit(LAG, records, offset="estimate")
        table = est.parameters
        hits.append((table["lower"] <= [50, 20]) & (table["upper"] >= [50, 20]))
    assert len(est.notes) == 2
    # 57 expected; fewer than 51 once in a thousand
    assert (np.sum(hits, axis=0) >= 51).all()


def test_an_offset_needs_the_line_at_zero(plant, slow):
    with pytest.raises(ValueError, match="line at zero"):
        fq.fit(LAG, fq.simulate(LAG, fq.white_noise(500), DT), offset="estimate", band=(1, 40))
    with pytest.raises(ValueError, match="offset"):
        fq.fit(LAG, fq.simulate(LAG, fq.white_noise(500), DT), offset="known")


def spiked(seed, share=0.03):
    record = fq.simulate(LAG, fq.white_noise(1000, seed=seed), DT).with_noise(0.05, seed=seed)
    rng = np.random.default_rng(seed + 9)
    y = np.array(record.y)
    hit = rng.random(1000) < share
    y[hit] += 5 * rng.standard_normal(hit.sum())
    return fq.Record(record.u, y, DT)


@pytest.mark.study
def test_hubers_loss_forgives_spikes():
    squares, robust, inside = [], [], []
    for seed in range(40):
        record = spiked(seed)
        est = fq.fit(LAG, record, loss="huber")
        table = est.parameters
        robust.append(table["value"] / [50, 20] - 1)
        squares.append(fq.fit(LAG, record).values / [50, 20] - 1)
        inside.append((table["lower"] <= [50, 20]) & (table["upper"] >= [50, 20]))
    assert "Huber" in est.notes[0]
    assert (np.std(robust, axis=0) < 0.25 * np.std(squares, axis=0)).all()
    assert (np.sum(inside, axis=0) >= 34).all()


def test_spikes_have_no_part_in_initial_states():
    """They had had: error bars were up to 1.7 times wider, samples far off three times as many."""
    slow = fq.first_order(7.5, 2.5)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        good = fq.simulate(slow, rng.standard_normal(300), 0.05).with_noise(0.005, seed=seed)
        spikes = np.zeros(300)
        spikes[rng.choice(300, 6, replace=False)] = 2.5 * rng.choice([-1, 1], 6)
        clean, spiky = (
            fq.fit(slow, fq.Record(good.u, good.y + e, good.dt), loss="huber") for e in (0, spikes)
        )
        # what is cut still adds what samples at the limit do
        assert spiky.cost < 1.12 * clean.cost
        assert (spiky.parameters["std"] < 1.2 * clean.parameters["std"]).all()


def test_hubers_loss_costs_little_where_nothing_is_wrong():
    record = fq.simulate(LAG, fq.white_noise(2000, seed=4), DT).with_noise(0.1, seed=4)
    plain, robust = fq.fit(LAG, record), fq.fit(LAG, record, loss="huber")
    ratio = robust.parameters["std"] / plain.parameters["std"]
    # 1/0.964 in variance for a cut at 1.5 standard deviations
    assert ratio.to_numpy() == pytest.approx([1.02, 1.02], abs=0.04)
    with pytest.raises(ValueError, match="needs all lines"):
        fq.fit(LAG, record, loss="huber", band=(1, 20))
    with pytest.raises(ValueError, match="loss"):
        fq.fit(LAG, record, loss="cauchy")


def test_progress_is_shown_and_changes_nothing(capsys):
    record = fq.simulate(LAG, fq.white_noise(300), DT).with_noise(0.1)
    assert np.array_equal(fq.fit(LAG, record, progress=True).values, fq.fit(LAG, record).values)


def test_a_fit_says_what_it_does_to_those_who_listen(caplog, capsys):
    record = fq.simulate(LAG, fq.white_noise(300, seed=3), 5e-3).with_noise(0.3, seed=1)
    fq.fit(LAG, record, start={"b": 400.0, "a": 2.0})
    assert not caplog.text
    with caplog.at_level("DEBUG", logger="freqid"):
        est = fq.fit(LAG, record, start={"b": 400.0, "a": 2.0})
    assert "first start: cost" in caplog.text
    assert f"GreyBox: cost {est.cost:.6g}" in caplog.text
    with caplog.at_level("INFO", logger="freqid"):
        fq.fit_many(LAG, {"gone": "no/such/file.csv"}, progress=False)
    assert "gone: " in caplog.text
    # nobody listens: nothing is printed
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("option", "cure"), [("bounds", "with_bounds"), ("prior", "with_prior"), ("fix", "fix")]
)
def test_what_belongs_to_the_model_is_said(option, cure):
    record = fq.simulate(fq.first_order(), fq.white_noise(50), 1e-3)
    with pytest.raises(ValueError, match=rf"{option} is no argument of fit: .*model\.{cure}"):
        fq.fit(fq.first_order(), record, **{option: {"a": (1, 2)}})
    with pytest.raises(TypeError, match="boundz"):
        fq.fit(fq.first_order(), record, boundz=1)


def test_errors_of_one_of_several_records_say_which():
    model = fq.first_order()
    fast, slow = (fq.simulate(model, fq.chirp(2, 40, 2, dt), dt) for dt in (1e-3, 1e-2))
    with pytest.raises(ValueError, match=r"^data\[1\]: band"):
        fq.fit(model, [fast, slow], band=(2, 80))
    with pytest.raises(ValueError, match=r"^data\[1\]: weights has shape \(7,\)"):
        fq.fit(model, [fast, slow], weights=[None, np.ones(7)])
    with pytest.raises(ValueError, match=r"^band"):
        fq.fit(model, slow, band=(2, 80))


def test_a_response_has_no_samples_at_rest():
    """An assertion without a word."""
    record = fq.simulate(fq.first_order(), fq.white_noise(600), 1e-3)
    for data in (fq.h1(record, segment=100), [record, fq.h1(record, segment=100)]):
        with pytest.raises(ValueError, match="initial_state='zero' needs samples: a record"):
            fq.fit(fq.first_order(), data, initial_state="zero")


def test_a_record_that_is_given_twice_is_noted():
    """Its error bars were smaller by the root of two, without a word."""
    plant = fq.first_order(b=20.0, a=20.0)
    record = fq.simulate(plant, fq.white_noise(400, seed=1), 5e-3).with_noise(0.05, seed=1)
    other = fq.simulate(plant, fq.white_noise(400, seed=2), 5e-3).with_noise(0.05, seed=2)
    same = fq.Record(record.u.copy(), record.y.copy(), record.dt)
    est = fq.fit(plant, [record, other, same])
    assert [n for n in est.notes if "records 0 and 2 are the same samples" in n]
    assert not [n for n in fq.fit(plant, [record, other]).notes if "same samples" in n]


def test_channels_that_are_taken_by_place_are_noted():
    plant = fq.GreyBox(
        lambda a: ([[-a, 0], [0, -2 * a]], [[a], [a]], [[1, 0], [0, 1]], None),
        [fq.Parameter("a", 10.0)],
    )
    records = [
        fq.simulate(plant, fq.white_noise(300, seed=k), 5e-3).with_noise(0.05, seed=k)
        for k in range(2)
    ]
    named = [
        fq.Record(r.u, r.y, r.dt, output_names=["wm", name])
        for r, name in zip(records, ("wl", "wx"), strict=True)
    ]
    est = fq.fit(plant, named)
    assert [n for n in est.notes if "record 1 has wx among its outputs" in n]
    assert not fq.fit(plant, [named[0], named[0].slice(0, 1)]).notes
