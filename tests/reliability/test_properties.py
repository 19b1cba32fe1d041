"""What must not matter does not: units, order, splitting, rates and round trips, of any plant."""

import dataclasses

import control
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import freqid as fq
from freqid.lti import StateSpace
from freqid.models.output_error import invert_hold

FEW = settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
HOLDS = {"zoh": fq.ZeroOrderHold, "foh": fq.FirstOrderHold}


@dataclasses.dataclass(frozen=True)
class Case:
    """A plant as matrices, a sample time to match, a hold, and a seed for its input."""

    system: tuple
    dt: float
    hold: object
    seed: int
    kind: str

    @property
    def plant(self):
        return control.ss(*self.system)

    def input(self, n=160):
        u = np.random.default_rng(self.seed).standard_normal((n, self.system[1].shape[1]))
        return u[:, 0] if u.shape[1] == 1 else u


@st.composite
def cases(draw, kinds=("stable", "unstable", "integrating", "defective", "stiff"), channels=3):
    """Plants of up to twelve states and three by three channels."""
    seed = draw(st.integers(0, 2**20))
    rng = np.random.default_rng(seed)
    kind, n = draw(st.sampled_from(kinds)), draw(st.integers(1, 12))
    m, p = draw(st.integers(1, channels)), draw(st.integers(1, channels))
    rates = 10.0 ** (rng.uniform(-3, 3, n) if kind == "stiff" else rng.uniform(-0.5, 0.5, n))
    A = np.diag(-rates)
    if kind == "unstable":
        A[0, 0] = 0.3
    elif kind == "integrating":
        A[0, 0] = 0.0
    elif kind == "defective":
        A = -np.eye(n) + np.eye(n, k=1)
    T = np.linalg.qr(rng.standard_normal((n, n)))[0]
    A = T @ A @ T.T
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    dt = 10.0 ** draw(st.integers(-3, 0)) if kind == "stiff" else draw(st.floats(0.02, 0.3))
    hold = HOLDS[draw(st.sampled_from(sorted(HOLDS)))](dt)
    return Case((A, B, C, np.zeros((p, m))), dt, hold, seed, kind)


def near(a, b, rel=1e-9):
    assert np.abs(a - b).max() <= rel * max(np.abs(b).max(), 1e-300)


@given(cases(), st.floats(-3, 3), st.floats(-3, 3))
@FEW
def test_simulation_is_linear(case, a, b):
    u, v = case.input(), case.input()[::-1]
    y, z, both = (
        fq.simulate(case.plant, x, case.dt, hold=case.hold).y for x in (u, v, a * u + b * v)
    )
    largest = np.abs(y).max() + np.abs(z).max()
    assert np.abs(both - (a * y + b * z)).max() <= 1e-9 * largest * (1 + abs(a) + abs(b))


@given(cases(), st.integers(1, 20))
@FEW
def test_what_comes_later_acts_later(case, late):
    u = case.input()
    zeros = np.zeros((late, *u.shape[1:]))
    hold = fq.ZeroOrderHold(case.dt)
    y = fq.simulate(case.plant, u, case.dt, hold=hold).y
    shifted = fq.simulate(case.plant, np.concatenate([zeros, u]), case.dt, hold=hold).y
    assert not shifted[:late].any()
    near(shifted[late:], y)


@given(cases(), st.floats(1e-6, 1e6))
@FEW
def test_the_unit_of_time_does_not_matter(case, unit):
    A, B, C, D = case.system
    u = case.input()
    y = fq.simulate(case.plant, u, case.dt, hold=case.hold).y
    slower = control.ss(A / unit, B / unit, C, D)
    hold = type(case.hold)(case.dt * unit)
    near(fq.simulate(slower, u, case.dt * unit, hold=hold).y, y, 1e-8)


def grey(case):
    """The plant as a grey box, which has responses through a hold."""
    A, B, C, D = case.system
    return fq.GreyBox(lambda one: (A, one * B, C, D), [fq.Parameter("one", 1.0)])


@given(cases(kinds=("stable", "defective")))
@FEW
def test_time_and_frequency_agree(case):
    """Once the transient has died a periodic input comes out times the response, line by line."""
    slowest = -np.linalg.eigvals(case.system[0]).real.max()
    N = 64
    periods = int(60 / (slowest * case.dt * N)) + 2
    one = np.random.default_rng(case.seed).standard_normal((N, case.system[1].shape[1]))
    y = fq.simulate(case.plant, np.tile(one, (periods, 1)), case.dt, hold=case.hold).y
    Y = np.fft.rfft(y.reshape(periods, N, -1)[-1], axis=0)[1:-1]
    omega = 2 * np.pi * np.arange(1, N // 2) / (N * case.dt)
    G = grey(case).frequency_response(omega, case.hold).response
    near(np.einsum("pmk,km->kp", G, np.fft.rfft(one, axis=0)[1:-1]), Y, 1e-8)


@given(cases(kinds=("stable", "integrating", "defective"), channels=2), st.integers(2, 8))
@FEW
def test_a_kept_input_keeps_the_plant(case, factor):
    """Decimated with its input a record meets the very same plant."""
    record = fq.simulate(case.plant, case.input(320), case.dt, hold=case.hold)
    slow = record.decimate(factor, keep_input=True)
    assert fq.compare(case.plant, slow).fit_percent.min() > 100 - 1e-5


@given(cases(kinds=("stable", "stiff"), channels=2))
@FEW
def test_responses_are_those_of_the_sampled_plant(case):
    """Through a zero-order hold: those of scipy's discretisation, at any frequency."""
    omega = np.linspace(0.01, 0.99, 9) * np.pi / case.dt
    ours = fq.FrequencyResponse.from_control(
        control.frd(
            control.c2d(case.plant, case.dt, "zoh")(np.exp(1j * omega * case.dt), squeeze=False),
            omega,
        )
    )
    through = grey(case).frequency_response(omega, fq.ZeroOrderHold(case.dt)).response
    # scipy's own exponential loses digits where the plant is stiff
    near(through, ours.response, 1e-6)


LAG = fq.first_order(b=40.0, a=25.0)


def lag_record(seed, n=300, noise=0.1):
    u = fq.white_noise(n, seed=seed)
    record = fq.simulate(LAG, u, 0.01)
    return record.with_noise(noise * record.y.std(), seed=seed)


@given(st.integers(0, 1000), st.floats(1e-8, 1e8), st.floats(1e-8, 1e8))
@FEW
def test_units_of_the_signals_scale_the_gain_alone(seed, of_input, of_output):
    record = lag_record(seed)
    other = fq.Record(record.u * of_input, record.y * of_output, record.dt)
    start = {"b": 30.0 * of_output / of_input, "a": 30.0}
    one = fq.fit(LAG, record, start={"b": 30.0, "a": 30.0})
    two = fq.fit(LAG.with_values(**start), other)
    assert two["a"] == pytest.approx(one["a"], rel=1e-7)
    assert two["b"] * of_input / of_output == pytest.approx(one["b"], rel=1e-7)
    ratio = two.parameters["std"] / one.parameters["std"]
    assert ratio["a"] == pytest.approx(1, rel=1e-5)
    assert ratio["b"] * of_input / of_output == pytest.approx(1, rel=1e-5)
    assert two.verdict.grade == one.verdict.grade


@given(st.integers(0, 1000), st.permutations(range(3)))
@FEW
def test_the_order_of_experiments_does_not_matter(seed, order):
    records = [lag_record(seed + i, 150) for i in range(3)]
    one, two = (fq.fit(LAG, rs) for rs in (records, [records[i] for i in order]))
    assert two.values == pytest.approx(one.values, rel=1e-8)
    assert two.cost == pytest.approx(one.cost, rel=1e-9)
    assert two.parameters["std"].tolist() == pytest.approx(one.parameters["std"].tolist(), rel=1e-6)


@given(st.integers(0, 1000), st.integers(60, 240))
@FEW
def test_splitting_a_record_costs_an_initial_state_and_no_more(seed, at):
    record = lag_record(seed)
    whole = fq.fit(LAG, record)
    halves = fq.fit(LAG, [record.slice(stop=at * 0.01), record.slice(at * 0.01)])
    # one more free state can only lower the cost, and by about the noise of one sample
    assert halves.cost <= whole.cost * (1 + 1e-9)
    assert halves.cost >= whole.cost * (1 - 25 / record.n_samples)
    moved = np.abs(halves.values - whole.values) / whole.parameters["std"]
    assert moved.max() < 1


@given(st.integers(0, 1000))
@FEW
def test_an_experiment_made_twice_tells_twice_as_much(seed):
    record = lag_record(seed)
    one, two = fq.fit(LAG, record), fq.fit(LAG, [record, record])
    assert two.values == pytest.approx(one.values, rel=1e-7)
    assert two.cost == pytest.approx(2 * one.cost, rel=1e-9)


@given(st.integers(0, 1000), st.permutations(range(3)))
@FEW
def test_the_order_of_channels_does_not_matter(seed, order):
    def matrices(a, b, c):
        return np.diag([-a, -b, -c]), np.eye(3), np.eye(3) + 0.3, np.zeros((3, 3))

    values = {"a": 10.0, "b": 30.0, "c": 70.0}
    names = {"inputs": ["u0", "u1", "u2"], "outputs": ["y0", "y1", "y2"]}
    model = fq.GreyBox(matrices, [fq.Parameter(n, v) for n, v in values.items()], **names)
    u = np.random.default_rng(seed).standard_normal((120, 3))
    made = fq.simulate(model, u, 0.01)
    made = made.with_noise(0.05 * made.y.std(axis=0), seed=seed)
    ins, outs = list(names["inputs"]), list(names["outputs"])
    record = fq.Record(made.u, made.y, 0.01, input_names=ins, output_names=outs)
    turned = fq.Record(
        made.u[:, order], made.y[:, order], 0.01,
        input_names=[ins[i] for i in order], output_names=[outs[i] for i in order],
    )  # fmt: skip
    one, two = fq.fit(model, record), fq.fit(model, turned)
    assert two.values == pytest.approx(one.values, rel=1e-7)


@given(cases(kinds=("stable",), channels=2))
@FEW
def test_sampling_and_back_is_nothing(case):
    """A sampled plant, its hold inverted, is the plant that was sampled."""
    A, B, C, D = case.system
    # a plant whose poles are told apart by the samples
    if np.abs(np.linalg.eigvals(A)).max() * case.dt > 1.5:
        return
    phi, gamma, following = case.hold.sampled(A, B)
    if case.hold.name == "foh":
        # the state that has taken the part of the next sample in
        gamma, D = gamma + phi @ following, D + C @ following
    back = control.ss(*invert_hold(StateSpace(phi, gamma, C, D), case.dt, case.hold))
    omega = np.array([0.1, 1.0, 3.0])
    near(back(1j * omega), case.plant(1j * omega), 1e-5)
