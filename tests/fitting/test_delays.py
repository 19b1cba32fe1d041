"""Delays on finite records, of parts of a sample, against simulation on a fine grid."""

import control
import numpy as np
import pandas as pd
import pytest
import scipy.signal

import freqid as fq

DT, FINE = 0.01, 100


def lag(**values):
    """b/(s + a) behind Td; the function does not know of Td."""
    model = fq.GreyBox(
        lambda b, a: ([[-a]], [[b]], [[1.0]], None),
        [fq.Parameter("b", 50.0), fq.Parameter("a", 20.0), fq.Parameter("Td", 0.0, unit="s")],
        input_delay="Td",
    )
    return model.with_values(**values)


def late_record(steps, n=460, seed=0):
    """White input held at DT, shifted on a grid a hundred times finer: an independent oracle."""
    u = np.random.default_rng(seed).standard_normal(n)
    fine = np.repeat(u, FINE)
    late = np.concatenate([np.zeros(round(steps * FINE)), fine])[: len(fine)]
    y = fq.simulate(fq.first_order(b=50, a=20), late, DT / FINE).y[::FINE]
    return fq.Record(u, y, DT)


@pytest.mark.study
@pytest.mark.parametrize("steps", [0, 0.18, 1, 3.4, 7])
@pytest.mark.parametrize("cut", ["whole", "running", "slow"])
def test_a_late_plant_is_as_exact_as_one_in_time(steps, cut):
    record = late_record(steps)
    model = lag(Td=steps * DT)
    assert np.abs(fq.simulate(model, record.u, DT).y - record.y).max() < 1e-11
    if cut != "whole":
        record = record.slice(0.6, 4.6)
    if cut == "slow":
        record = record.decimate(4, keep_input=True)
    assert fq.compare(model, record).fit_percent[0] > 100 - 1e-8
    est = fq.fit(lag(), record, start={"b": 60.0, "a": 15.0, "Td": 0.7 * steps * DT + 0.002})
    assert est["Td"] == pytest.approx(steps * DT, abs=1e-7 * DT)
    assert est["a"] == pytest.approx(20, rel=1e-7)
    known = fq.fit(lag(Td=steps * DT).fix("Td"), record, start={"b": 60.0, "a": 15.0})
    assert known["b"] == pytest.approx(50, rel=1e-9)


@pytest.mark.parametrize("steps", [0.18, 0.25, 3.4])
@pytest.mark.parametrize("known", [True, False])
def test_black_boxes_behind_a_delay(steps, known):
    record = late_record(steps).slice(0.6, 4.6)
    delay = steps * DT if known else "estimate"
    est = fq.fit(fq.TransferFunction(0, 1, delay=delay), record)
    assert est.model.delay == pytest.approx(steps * DT, abs=1e-6 * DT)
    assert est.fit_percent > 100 - 1e-8


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_error_bars_and_witness_of_a_delay(seed):
    record = late_record(3.4, 660, seed).with_noise(0.2, seed=seed).slice(0.6, 6.6)
    est = fq.fit(lag(), record, start={"Td": 0.01, "b": 80.0, "a": 10.0})
    std = est.parameters["std"]
    assert abs(est["Td"] - 3.4 * DT) < 4 * std["Td"] < 0.2 * DT
    # a black box behind the same delay has no more freedom than a lag
    assert est.witness.verdict == "absent"


def test_the_witness_of_a_late_drivetrain():
    late = fq.drivetrain(2, input_delay="Td")
    clean = fq.simulate(late.with_values(Td=3.3e-3), fq.chirp(5, 80, 4, 1e-3), 1e-3)
    record = clean.with_noise(0.05, seed=2)
    est = fq.fit(late, record)
    assert est["Td"] == pytest.approx(3.3e-3, abs=4 * est.parameters["std"]["Td"])
    assert est.witness.verdict == "complete"
    assert fq.fit(fq.drivetrain(2), record).witness.verdict == "lacking"


@pytest.mark.parametrize("seed", range(4))
def test_a_delay_in_a_local_response_never_costs_more_than_its_start(seed):
    """The black box's delay took the place of the start: a cost of 26,000 where the start has 7."""
    late = fq.GreyBox(
        lambda b, a, T: ([[-a]], [[b]], [[1.0]], None),
        [fq.Parameter("b", 100.0), fq.Parameter("a", 100.0), fq.Parameter("T", 0.0023)],
        input_delay="T",
    )
    record = fq.simulate(late, fq.white_noise(2000, seed=seed), 1e-3)
    record = record.with_noise(0.02 * record.y.std(), seed=seed + 1)
    est = fq.fit(late, fq.local_rational(record))
    assert est["T"] == pytest.approx(0.0023, abs=5e-5)
    assert est["a"] == pytest.approx(100, rel=0.02)


@pytest.mark.study
def test_an_output_that_comes_before_the_input_is_named():
    record = late_record(0, 600)
    early = fq.Record(record.u[:-20], record.y[20:], DT)
    est = fq.fit(lag(), early)
    assert est.warnings
    assert est.witness.verdict != "complete"
    with pytest.raises(ValueError, match="outlasts half"):
        fq.fit(lag(), record, start={"Td": 100.0})
    with pytest.raises(ValueError, match="hold='estimate'"):
        fq.fit(lag(), record, hold="estimate")


def test_each_input_may_have_a_delay_of_its_own():
    model = fq.GreyBox(
        lambda b, a, c: ([[-a]], [[b, c]], [[1.0]], [[0.0, 0.3]]),
        [fq.Parameter("b", 50.0), fq.Parameter("a", 20.0), fq.Parameter("c", -30.0),
         fq.Parameter("Td", 0.0234)],
        input_delay=["Td", 0.02],
    )  # fmt: skip
    u = np.random.default_rng(3).standard_normal((500, 2))
    record = fq.simulate(model, u, DT).slice(0.5, 4.8)
    est = fq.fit(model, record, start={"Td": 0.01, "c": -20.0})
    assert est["Td"] == pytest.approx(0.0234, rel=1e-7)
    assert est["c"] == pytest.approx(-30, rel=1e-7)


def test_a_delay_in_a_response_and_as_pade():
    model = lag(Td=0.034)
    omega = np.linspace(1, 60, 30)
    plain = fq.first_order(b=50, a=20).frequency_response(omega).response[0, 0]
    late = model.frequency_response(omega).response[0, 0]
    assert np.allclose(late, plain * np.exp(-0.034j * omega), rtol=1e-12)
    with pytest.raises(ValueError, match="pade"):
        model.to_control()
    near = control.frequency_response(model.to_control(pade=4), omega).complex
    assert np.allclose(near, late, rtol=1e-3)


@pytest.mark.parametrize(
    ("delay", "text"),
    [("tau", "tau"), (np.nan, "input_delay"), ([0.1, 0.2], "2 entries for 1")],
)
def test_a_delay_that_cannot_be_is_refused(delay, text):
    with pytest.raises(ValueError, match=text):
        fq.GreyBox(
            lambda a: ([[-a]], [[1.0]], [[1.0]], None),
            [fq.Parameter("a", 1.0)],
            input_delay=delay,
        )


def test_a_late_input_needs_a_hold_that_is_constant():
    record = late_record(3.4)
    with pytest.raises(ValueError, match="zero-order hold"):
        fq.fit(lag(Td=0.03), record, hold="foh")
    with pytest.raises(ValueError, match="domain='frequency'"):
        fq.fit(lag(Td=0.03), record, domain="time")


@pytest.mark.parametrize("keep_input", [True, False])
def test_a_delay_of_a_decimated_record_is_found(keep_input):
    u = fq.chirp(0.5, 20, 8, DT)
    fine = np.concatenate([np.zeros(340), np.repeat(u, FINE)])[: len(u) * FINE]
    y = fq.simulate(fq.first_order(b=50, a=20), fine, DT / FINE).y[::FINE]
    record = fq.Record(u, y, DT).slice(0.5, 7.5).decimate(2, keep_input=keep_input)
    est = fq.fit(fq.TransferFunction(0, 1, delay="estimate"), record)
    assert est.model.delay == pytest.approx(3.4 * DT, abs=0.05 * DT)
    grey = fq.fit(lag(), record, start={"b": 60.0, "a": 15.0})
    assert grey["Td"] == pytest.approx(3.4 * DT, abs=0.05 * DT)


def swinging(delay=0.1):
    """A lightly damped motion of 12 rad/s that comes late."""
    return fq.GreyBox(
        lambda w, z, g: ([[0, 1], [-w * w, -2 * z * w]], [[0], [g * w * w]], [[1, 0]], [[0]]),
        [fq.Parameter("w", 12.0), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0),
         fq.Parameter("Td", delay, "s", lower=-1.0, upper=1.0)],
        input_delay="Td",
    )  # fmt: skip


def swung(seed, delay, samples=400, before=100):
    """A record that begins when the input has been acting for long."""
    u = fq.white_noise(samples + before, seed=seed)
    y = fq.simulate(swinging(delay), u, 0.01).y[before:]
    y = y + 0.01 * y.std() * np.random.default_rng(seed).standard_normal(samples)
    return fq.Record(u[before:], y, 0.01)


@pytest.mark.study
@pytest.mark.parametrize("delay", [0.034, 0.154, 0.396])
def test_error_bars_of_delays_of_many_samples(delay):
    score, std = [], []
    for seed in range(16):
        record = swung(seed, delay)
        est = fq.fit(swinging(delay), record, n_starts=1)
        std.append(est.parameters["std"]["Td"])
        score.append((est["Td"] - delay) / std[-1])
    assert np.sqrt(np.mean(np.square(score))) == pytest.approx(1, abs=0.45)
    assert max(std) < 10 * min(std)


@pytest.mark.parametrize("delay", [0.296, 0.396, -0.296])
def test_the_cost_is_smooth_in_a_long_delay(delay):
    u = fq.white_noise(1200, seed=5)
    y = fq.simulate(swinging(max(delay, 0.0)), u, 0.01).y
    ahead = max(-round(delay / 0.01), 0)
    y = np.roll(y, -ahead)[100 : 1100 - ahead]
    u = u[100 : 1100 - ahead]
    cost = [
        fq.fit(swinging(delay + step).fix("Td", "w", "z"), fq.Record(u, y, 0.01), n_starts=1).cost
        for step in np.linspace(-2e-3, 2e-3, 9)
    ]
    rough = np.abs(np.diff(cost, 4))
    assert rough.max() < 0.05 * np.ptp(cost)


@pytest.mark.study
@pytest.mark.parametrize("delay", [0.004, 0.213, 0.396])
@pytest.mark.parametrize("seed", range(3))
def test_a_delay_of_many_samples_is_found_without_a_start(delay, seed):
    est = fq.fit(swinging(0.0), swung(seed, delay))
    assert est["Td"] == pytest.approx(delay, abs=5 * est.parameters["std"]["Td"])
    assert est.verdict.grade == "trust"


@pytest.mark.study
@pytest.mark.parametrize("late", [0.013, 0.042])
def test_a_delay_and_weights_go_together(late):
    """Found: a known delay of more than a sample and weights="noise" ended in numpy's words."""

    def lag(a, b):
        return [[-a]], [[b]], [[1]], [[0]]

    plant = fq.GreyBox(lag, [fq.Parameter("a", 20.0), fq.Parameter("b", 50.0)], input_delay=late)
    complete = []
    for seed in range(6):
        record = fq.simulate(plant, fq.white_noise(600, seed=seed), 0.01)
        e = np.random.default_rng(seed).standard_normal(900)
        noise = scipy.signal.lfilter([np.sqrt(0.19)], [1, -0.9], e)[300:]
        record = fq.Record(record.u, record.y + 0.1 * record.y.std() * noise, 0.01)
        est = fq.fit(plant, record, weights="noise")
        assert est.verdict.grade == "trust", est.verdict
        complete.append(est.witness.verdict)
        given = np.linspace(1, 3, 301)
        assert fq.fit(plant, record, weights=given).witness.verdict != "absent"
    assert complete.count("complete") >= 5, complete


def test_a_delay_that_a_zero_may_take_over_has_no_errors_to_trust():
    """Errors of 1e7, or none, were given and trusted where the numerator's first power is zero."""

    def mode(w, z, g):
        return [[0, w], [-w, -2 * z * w]], [[0], [g * w]], [[1, 0]], None

    plant = fq.GreyBox(
        mode, [fq.Parameter(n, v) for n, v in (("w", 40.0), ("z", 0.08), ("g", 1.5))]
    )
    u = np.random.default_rng(2).standard_normal(500)
    fast = np.concatenate([np.zeros(281), np.repeat(u, 100)])[: 500 * 100]
    record = fq.Record(u, fq.simulate(plant, fast, 1e-4).y[::100], 0.01).with_noise(0.05, seed=1)
    est = fq.fit(fq.TransferFunction(1, 2, delay="estimate"), record)
    assert est.model.delay == pytest.approx(0.0281, abs=1e-3)
    std = est.parameters["std"]
    assert not std.isna().any()
    assert std.max() > 1e3 * std.min()
    assert any(w.kind == "not identifiable" for w in est.warnings)
    assert est.verdict.grade != "trust"
    # the response is as sure as that of the plant itself: what cancels in it is no error of it
    omega = np.array([5.0, 20.0, 40.0, 80.0])
    own = fq.fit(plant, fq.Record(u, record.y, 0.01), start={"w": 40.0}, n_starts=1)
    late = est.frequency_response(omega)
    assert (late.variance > 0).all()
    assert (late.variance < 10 * own.frequency_response(omega).variance).all()


@pytest.mark.study
@pytest.mark.parametrize("kind", ["white", "chirp"])
def test_no_delay_at_all_is_a_delay_that_is_told(kind):
    """Its error, far below a sample, is more than half of what is next to zero: "not settled"."""
    free = fq.first_order(b=40.0, a=25.0)
    free = fq.GreyBox(
        free.matrices,
        [*free.parameters, fq.Parameter("Td", 0.0, "s", lower=0)],
        input_delay="Td",
    )
    u = fq.white_noise(1500, seed=3) if kind == "white" else fq.chirp(0.5, 60, 3, 2e-3)
    grades = []
    for seed in range(8):
        record = fq.simulate(free, u, 2e-3).with_noise(0.02, seed=seed)
        est = fq.fit(free, record, start={"a": 32.0, "Td": 1e-3})
        assert est["Td"] < 1e-4
        assert est.witness.verdict != "lacking" or est.witness.p_value > 1e-3
        grades.append(est.verdict.grade)
    assert grades.count("trust") >= 7


@pytest.mark.study
@pytest.mark.parametrize("delay", [0.0013, 0.007])
@pytest.mark.parametrize("masses", [2, 3])
def test_one_more_mode_behind_a_delay_is_named(masses, delay):
    """Black boxes with a mode more stood beside plants in time only: "tone", "drift", nothing."""

    def chain(count, late):
        def matrices(m, k, d):
            coupled = np.diff(np.eye(count), axis=0)
            L = coupled.T @ coupled
            A = np.block(
                [[np.zeros((count, count)), np.eye(count)], [-k / m * L, -d / m * (L + ends)]]
            )
            return A, np.r_[np.zeros(count), ends[:, 0] / m][:, None], np.eye(2 * count)[[count]]

        ends = np.diag(np.eye(count)[0])
        values = {"m": 1.0, "k": 4000.0, "d": 2.0}
        return fq.GreyBox(
            lambda m, k, d, Td: (*matrices(m, k, d), None),
            [*(fq.Parameter(n, v, lower=0) for n, v in values.items()),
             fq.Parameter("Td", late, "s", lower=0)],
            input_delay="Td",
        )  # fmt: skip

    record = fq.simulate(chain(masses, delay), fq.white_noise(2000, seed=1), 2e-3)
    est = fq.fit(chain(2, delay), record.with_noise(0.02 * record.y.std(), seed=2))
    if masses == 2:
        assert est.verdict.trusted
        return
    assert est.warnings[0].kind == "another mode"
    assert not est.verdict.trusted


@pytest.mark.study
@pytest.mark.parametrize("steps", [0, 0.18, 1, 3.4, 7])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_late_plant_begins_at_rest(steps, noise):
    """Refused before: what the input did before the record is known to be nothing."""
    record = late_record(steps)
    e = np.random.default_rng(9).standard_normal(record.n_samples)
    record = fq.Record(record.u, record.y + noise * record.y.std() * e, DT)
    for band in (None, (0, 20)):
        est = fq.fit(lag(b=60, a=25), record, initial_state="zero", band=band)
        table = est.parameters
        true = pd.Series({"b": 50.0, "a": 20.0, "Td": steps * DT})
        error = (table["value"] - true).abs()
        assert (error < (4 * table["std"] if noise else 1e-10 * (true + 1))).all()
        assert est.verdict.trusted
    with pytest.raises(ValueError, match="initial_state='zero'"):
        fq.fit(lag(), record, domain="time")


@pytest.mark.parametrize("steps", [0.18, 1, 3.4])
def test_derivatives_of_late_samples_are_those_of_differences(steps):
    record = late_record(steps)
    est = fq.fit(lag(Td=steps * DT), record, initial_state="zero")
    objective, x = est.minimum.objective, 1.05 * est.minimum.x
    at = objective.point(x)
    for i, step in enumerate(1e-6 * x):
        below, above = (objective.point(x + s * step * np.eye(3)[i]).cost for s in (-1, 1))
        gradient = 2 * at.jacobian[:, i] @ at.residual
        assert (above - below) / (2 * step) == pytest.approx(gradient, rel=1e-5)
