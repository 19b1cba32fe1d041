"""Channels that are turned round are named, however the plant's parameters are bounded."""

import dataclasses

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT = 2e-3
POSITIVE = {"lower": 0.0}


def spring(m, c, k):
    A = np.array([[0, 1], [-k / m, -c / m]])
    return A, np.array([[0], [1 / m]]), np.array([[1.0, 0]]), np.zeros((1, 1))


def lag(gain, T):
    return np.array([[-1 / T]]), np.array([[gain / T]]), np.ones((1, 1)), np.zeros((1, 1))


def two_sensors(m, c, k):
    A, B, _, _ = spring(m, c, k)
    return A, B, np.eye(2), np.zeros((2, 1))


def two_mass(Jm, Jl, k, d, fm):
    A = np.array([[-(d + fm) / Jm, -k / Jm, d / Jm], [1, 0, -1], [d / Jl, k / Jl, -d / Jl]])
    return A, np.array([[1 / Jm], [0], [0]]), np.array([[1.0, 0, 0]]), np.zeros((1, 1))


def bounded(function, **values):
    return fq.GreyBox(function, [fq.Parameter(n, v, **POSITIVE) for n, v in values.items()])


SPRING = bounded(spring, m=1.0, c=2.0, k=400.0)
LAG = bounded(lag, gain=2.0, T=0.3)
TWO = bounded(two_mass, Jm=4e-3, Jl=5e-3, k=100.0, d=0.1, fm=0.05)
SENSORS = bounded(two_sensors, m=1.0, c=2.0, k=400.0)
INPUTS = {
    "chirp": fq.chirp(0.3, 60, 1500 * DT, DT),
    "white": fq.white_noise(1500, seed=5),
}


def measured(model, kind, noise, seed=1):
    """A record with this part of the output's size as noise."""
    record = fq.simulate(model, INPUTS[kind], DT)
    e = np.random.default_rng(seed).standard_normal(record.y.shape)
    return dataclasses.replace(record, y=record.y + noise * record.y.std(axis=0) * e)


def begun(model):
    return {n: v * (1.2 if i % 2 else 0.85) for i, (n, v) in enumerate(model.values.items())}


@pytest.mark.study
@pytest.mark.parametrize(
    ("model", "kind", "noise"),
    [
        (SPRING, "chirp", 0.02), (SPRING, "white", 0.2), (LAG, "white", 0.02), (LAG, "chirp", 1.5),
        (TWO, "white", 0.02),
    ],
)  # fmt: skip
def test_a_wrong_sign_is_named_where_bounds_keep_the_plant_from_following(model, kind, noise):
    """Found: "no signal", of data that the plant explains to their noise once they are turned."""
    record = measured(model, kind, noise)
    turned = fq.Record(record.u, -record.y, DT)
    est = fq.fit(model, turned, start=begun(model))
    assert est.warnings[0].kind == "wrong sign"
    assert est.verdict.grade == "do not use"
    assert fq.fit(model, record, start=begun(model)).verdict.trusted


@pytest.mark.parametrize(("model", "kind"), [(SPRING, "chirp"), (LAG, "white")])
def test_exchanged_channels_are_named_and_not_to_be_used(model, kind):
    """Found: "no signal", and a doubt only where they were named."""
    record = measured(model, kind, 0.02)
    est = fq.fit(model, fq.Record(record.y, record.u, DT), start=begun(model))
    assert est.warnings[0].kind == "swapped channels"
    assert est.verdict.grade == "do not use"


@pytest.mark.study
@pytest.mark.parametrize("channel", [0, 1])
def test_one_output_of_the_wrong_sign_is_named(channel):
    record = measured(SENSORS, "white", 0.05)
    y = record.y.copy()
    y[:, channel] *= -1
    names = ("position", "speed")
    est = fq.fit(SENSORS, fq.Record(record.u, y, DT, output_names=names), start=begun(SENSORS))
    first = est.warnings[0]
    assert first.kind == "wrong sign"
    assert repr(names[channel]) in first
    assert est.verdict.grade == "do not use"


@pytest.mark.study
def test_one_input_of_the_wrong_sign_is_named():
    def pushed(m, c, k):
        A, B, C, _ = spring(m, c, k)
        return A, np.column_stack([B, [[k / m], [-c * k / m**2]]]), C, np.zeros((1, 2))

    model = bounded(pushed, m=1.0, c=2.0, k=400.0)
    u = np.column_stack([fq.white_noise(1500, seed=2), 0.01 * fq.white_noise(1500, seed=3)])
    record = fq.simulate(model, u, DT)
    noise = 0.02 * record.y.std() * np.random.default_rng(1).standard_normal(record.y.shape)
    turned = fq.Record(u * [1, -1], record.y + noise, DT, input_names=("force", "ground"))
    est = fq.fit(model, turned, start=begun(model))
    assert est.warnings[0].kind == "wrong sign"
    assert "'ground'" in est.warnings[0]


def test_a_response_of_the_wrong_sign_is_named():
    omega = np.geomspace(2, 300, 60)
    found = 1 / (400 - omega**2 + 2j * omega)
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((60, 2)) @ [1, 1j] * 0.02 * np.abs(found).mean()
    frf = fq.FrequencyResponse(omega, -(found + noise))
    assert fq.fit(SPRING, frf, start=begun(SPRING)).warnings[0].kind == "wrong sign"


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_turned_where_the_input_is_not_heard(seed):
    rng = np.random.default_rng(seed)
    record = fq.Record(rng.standard_normal(1000), rng.standard_normal(1000), DT)
    kinds = [w.kind for w in fq.fit(SPRING, record, start=begun(SPRING)).warnings]
    assert "no signal" in kinds
    assert not {"wrong sign", "swapped channels"} & set(kinds)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_turned_in_noise_or_where_a_mode_is_missing(seed):
    loud = fq.fit(TWO, measured(TWO, "white", 2.0, seed), start=begun(TWO))
    lacking = fq.fit(SPRING, measured(TWO, "chirp", 0.02, seed), start=begun(SPRING))
    for est in (loud, lacking):
        assert not {"wrong sign", "swapped channels"} & {w.kind for w in est.warnings}


@pytest.mark.study
def test_means_of_periods_of_the_wrong_sign_are_named():
    u = fq.multisine((1, 60), 2, DT, periods=6)
    record = fq.simulate(SPRING, u, DT).with_noise(0.02)
    means = fq.periodic(fq.Record(record.u, -record.y, DT), period=2.0, skip=1)
    assert fq.fit(SPRING, means, start=begun(SPRING)).warnings[0].kind == "wrong sign"


@pytest.mark.study
def test_a_log_of_the_wrong_sign_is_named():
    record = measured(SPRING, "white", 0.02).slice(0, 2)
    rng = np.random.default_rng(1)
    kept = np.sort(rng.permutation(record.n_samples)[:800])
    log = fq.Record.from_logs(record.time, record.u, record.time[kept], -record.y[kept])
    assert fq.fit(SPRING, log, start=begun(SPRING)).warnings[0].kind == "wrong sign"


@pytest.mark.parametrize("model", [SPRING, LAG])
def test_a_wrong_sign_without_noise_is_named(model):
    """Found: "not physical" alone, since nothing is asked of data that are explained whole."""
    free = fq.GreyBox(model.matrices, [fq.Parameter(n, v) for n, v in model.values.items()])
    record = fq.simulate(model, INPUTS["white"], DT)
    est = fq.fit(free, fq.Record(record.u, -record.y, DT), start=begun(model))
    assert est.warnings[0].kind == "wrong sign"


@pytest.mark.study
@pytest.mark.parametrize("seed", range(2))
def test_what_looks_like_the_inverse_of_a_plant_from_far_is_not_exchanged(seed):
    def accelerometer(m, c, k):
        A, B, _, _ = spring(m, c, k)
        return A, B, [[-k / m, -c / m]], [[1 / m]]

    rng = np.random.default_rng(seed)
    u = rng.standard_normal(600)
    lead = fq.GreyBox(
        lambda T: ([[-1 / T]], [[(1 - 0.1 / T) / T]], [[1.0]], [[0.1 / T]]),
        [fq.Parameter("T", 0.6)],
    )
    y = fq.simulate(lead, u, 0.05).y
    record = fq.Record(u, y + 0.01 * y.std() * rng.standard_normal(600), 0.05)
    est = fq.fit(bounded(accelerometer, m=0.5, c=1.0, k=300.0), record)
    assert not {"wrong sign", "swapped channels"} & {w.kind for w in est.warnings}
    assert not est.verdict.trusted


@pytest.mark.study
def test_a_slow_output_of_the_wrong_sign_is_no_mirrored_mode():
    """Found: trusted, with 90 times the stiffness, where the input changes only with the output."""

    def speed(m, c, k):
        A, B, _, _ = spring(m, c, k)
        return A, B, [[0.0, 1.0]], [[0.0]]

    model, rng = bounded(speed, m=2.0, c=3.0, k=900.0), np.random.default_rng(0)
    record = fq.simulate(model, np.repeat(rng.standard_normal(400), 10), 1e-3)
    y = record.y + 0.1 * record.y.std() * rng.standard_normal(4000)
    for sign in (1, -1):
        slow = fq.Record(record.u, sign * y, 1e-3).decimate(10, keep_input=True)
        est = fq.fit(model, slow, start=begun(model))
        assert est.verdict.trusted if sign > 0 else est.warnings[0].kind == "wrong sign"


@pytest.mark.study
@pytest.mark.parametrize("times", [5.0, 1e6])
@pytest.mark.parametrize("model", [SPRING, LAG])
def test_slow_noise_turns_nothing(model, times):
    """Found in 20 of 63: lines that hold most of the noise are soon explained."""
    for seed in range(2):
        rng = np.random.default_rng([seed, 7])
        u = np.repeat(rng.standard_normal(15), 40)
        y = fq.simulate(model, u, 0.01).y
        e = scipy.signal.lfilter([1], [1, -0.98], rng.standard_normal(1100))[500:]
        record = fq.Record(u, y + times * y.std() / e.std() * e, 0.01)
        kinds = {w.kind for w in fq.fit(model, record, start=begun(model)).warnings}
        assert not {"wrong sign", "swapped channels"} & kinds


def test_dependent_inputs_are_not_taken_for_exchanged():
    """Of six fits with one chirp in both inputs four had begun with "exchange them"."""
    c, dt = fq.chirp(1, 20, 2.0, 2e-3), 2e-3
    plant = fq.GreyBox(
        lambda a, b, c, d: ([[-20, 0], [0, -50.0]], [[a, b], [c, d]], np.eye(2), None),
        [fq.Parameter(n, v) for n, v in zip("abcd", (20.0, 5.0, 10.0, 50.0), strict=True)],
        inputs=["u1", "u2"],
        outputs=["y1", "y2"],
    )
    for part in (1.0, -0.5):
        record = fq.simulate(plant, np.column_stack([c, part * c]), dt).with_noise(0.01, seed=1)
        est = fq.fit(plant, record)
        kinds = [w.kind for w in est.warnings]
        assert kinds[0] == "not identifiable"
        assert not {"swapped channels", "wrong sign"} & set(kinds)
