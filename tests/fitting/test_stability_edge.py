"""Stable black boxes of data that want to grow: a minimum on the unit circle, that says so."""

import json

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.signal

import freqid as fq
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.held_charts import HeldChart
from freqid.fitting.suspects.parts import confirming
from freqid.lti import Plane, StateSpace
from freqid.models.written import model_of_dict, model_to_dict

DT = 0.01


def growing(seed, rate=0.15, f=7.0, n=800):
    """A lag under white input, with a sine beside it that grows."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(n)
    y = fq.simulate(fq.first_order(b=30.0, a=20.0), u, DT).y
    t = DT * np.arange(n)
    y = y + 0.5 * y.std() * np.exp(rate * t) * np.sin(2 * np.pi * f * t + seed)
    return fq.Record(u, y + 0.05 * y.std() * rng.standard_normal(n), DT)


def by_hand(record, pole, angle):
    """The pole and the angle of a pair on the circle that leave least: all else is linear."""
    u, y, n = record.u, record.y, len(record.u)

    def left(x):
        a = np.poly([x[0], np.exp(1j * x[1]), np.exp(-1j * x[1])]).real
        delayed = [np.r_[np.zeros(q), u[: n - q]] for q in (1, 2, 3)]
        columns = [scipy.signal.lfilter([1.0], a, v) for v in delayed]
        k = np.arange(n)
        columns += [x[0] ** k, np.cos(x[1] * k), np.sin(x[1] * k)]
        A = np.column_stack(columns)
        return y - A @ np.linalg.lstsq(A, y)[0]

    return scipy.optimize.least_squares(left, [pole, angle], xtol=1e-14, ftol=1e-14).x


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_least_on_the_circle(seed):
    """It stopped where it met the circle, not converged, and nothing was to be used."""
    record = growing(seed)
    est = fq.fit(fq.OutputError(3, stable=True), record)
    assert est.converged
    poles = est.model.poles
    assert (np.abs(poles) < 1).all()
    (pair,) = poles[poles.imag > 0]
    assert abs(pair) > 1 - 1e-5
    (pole,) = poles[poles.imag == 0].real
    expected = by_hand(record, pole, np.angle(pair))
    assert [pole, np.angle(pair)] == pytest.approx(expected, abs=2e-5)
    (said,) = [w for w in est.warnings if w.kind == "edge of a bound"]
    at = float(said.split(" at ")[1].split(" Hz")[0])
    assert at == pytest.approx(np.angle(pair) / (2 * np.pi * DT), rel=1e-3)
    assert at == pytest.approx(7.0, abs=0.05)
    assert "unstable" not in [w.kind for w in est.warnings]
    assert est.verdict.grade == "doubt"
    free = fq.fit(fq.OutputError(3), record)
    assert free.cost < est.cost
    assert np.abs(free.model.poles).max() > 1


def test_two_pairs_at_once_and_several_channels():
    one, two = growing(1), growing(2, f=17.0)
    both = fq.Record(one.u, one.y + growing(1, f=17.0).y, DT)
    est = fq.fit(fq.OutputError(5, stable=True), both)
    assert est.converged
    assert (np.abs(est.model.poles) < 1).all()
    assert np.sum(np.abs(est.model.poles) > 1 - 1e-5) == 4
    record = fq.Record(np.column_stack([one.u, two.u]), np.column_stack([one.y, two.y]), DT)
    est = fq.fit(fq.OutputError(6, stable=True), record)
    assert est.converged
    assert (np.abs(est.model.poles) < 1).all()


def test_derivatives_of_held_poles_are_those_of_differences():
    """Two pairs and a pole on the circle, two inputs and outputs."""
    rng = np.random.default_rng(0)
    w = [0.4, 1.3, 2.0]
    blocks = [
        np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) * r
        for a, r in zip(w, (0.9995, 0.9993, 0.8), strict=True)
    ]
    A = scipy.linalg.block_diag(*blocks, [[0.9999]])
    T = rng.standard_normal(A.shape)
    B, C = rng.standard_normal((7, 2)), rng.standard_normal((2, 7))
    model = StateSpace(T @ A @ np.linalg.inv(T), B, C, rng.standard_normal((2, 2)))
    chart = Chart(model, True, Plane(0.3), DT)
    held = HeldChart(chart, np.abs(np.linalg.eigvals(chart.centre.A)) > 0.99)
    assert held.size == chart.size - 3
    x = 1e-2 * rng.standard_normal(held.size)
    size = np.sort(np.abs(np.linalg.eigvals(held.matrices(x).A)))
    assert size[2:] == pytest.approx(np.full(5, 1 - 1e-7), abs=1e-12)
    change = held.realise(x).linearisation.derivative
    for i, step in enumerate(1e-6 * np.eye(held.size)):
        two = held.matrices(np.array([x + step, x - step]))
        for M, d in zip(two, change, strict=True):
            np.testing.assert_allclose((M[0] - M[1]) / 2e-6, d[i], atol=1e-8)


def test_what_is_stable_by_itself_is_left_alone():
    record = fq.simulate(fq.first_order(), fq.white_noise(500, seed=1), DT).with_noise(0.05)
    free, stable = (fq.fit(fq.OutputError(2, stable=s), record) for s in (False, True))
    assert stable.cost == pytest.approx(free.cost, rel=1e-6)
    assert "edge of a bound" not in [w.kind for w in stable.warnings]


W = 2 * np.pi * 6
ALONE = {
    "growing lag": ([1.0], [1.0, -0.2], 1),
    "double integrator": ([1.0], [1.0, 0.0, 0.0], 2),
    "growing mode": ([1.0], [1.0, -0.01 * W, W * W], 2),
    "two growing modes": (
        [3.0, 0.0, 1.0], np.polymul([1.0, -0.01 * W, W * W], [1.0, -0.02 * W, 4 * W * W]), 4
    ),
}  # fmt: skip


def angles_by_hand(record, angles, radius):
    """The angles of held poles, each above zero a pair, that leave least, and what is left."""
    u, y, k = record.u, record.y, np.arange(len(record.u))

    def left(x):
        z = radius * np.concatenate([np.exp([1j * t, -1j * t]) if t else [1.0] for t in x])
        delayed = [np.r_[np.zeros(q), u[: len(u) - q]] for q in range(1, len(z) + 1)]
        columns = [scipy.signal.lfilter([1.0], np.poly(z).real, v) for v in delayed]
        columns += [radius**k * f(t * k) for t in x for f in ([np.cos, np.sin] if t else [np.cos])]
        A = np.column_stack(columns)
        return y - A @ np.linalg.lstsq(A, y)[0]

    return scipy.optimize.least_squares(left, angles, xtol=1e-14, ftol=1e-14).x, left


@pytest.mark.study
@pytest.mark.parametrize("plant", ALONE)
def test_every_pole_may_be_held(plant):
    """Where no pole was free nothing was held: not converged, and never the edge of a bound."""
    above, below, order = ALONE[plant]
    sampled = scipy.signal.cont2discrete(scipy.signal.tf2ss(above, below), DT)[:4]
    b, a = scipy.signal.ss2tf(*sampled)
    met = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(400)
        y = scipy.signal.lfilter(b[0], a, u)
        record = fq.Record(u, y + 0.05 * y.std() * rng.standard_normal(400), DT)
        free = fq.fit(fq.OutputError(order), record)
        if np.abs(free.model.poles).max() < 1 + 1e-6:
            continue
        met += 1
        est = fq.fit(fq.OutputError(order, stable=True), record)
        assert (np.abs(est.model.poles) < 1).all()
        assert "edge of a bound" in [w.kind for w in est.warnings]
        angles = np.angle(est.model.poles[est.model.poles.imag > 0])
        if plant in ("growing mode", "two growing modes"):
            expected, _ = angles_by_hand(record, angles, np.abs(est.model.poles).max())
            assert angles == pytest.approx(expected, abs=2e-5)
        if plant == "growing lag":
            _, left = angles_by_hand(record, [0.0], np.abs(est.model.poles).max())
            said = record.y - np.ravel(fq.compare(est, record).simulated)
            assert np.sum(said**2) == pytest.approx(np.sum(left([0.0]) ** 2), rel=1e-6)
    assert met > 3


def test_motions_that_do_not_fade_in_data_without_noise():
    """A last step over the circle ended in "the model is unstable there", a bare error."""
    w, v = 2 * np.pi * 5, 2 * np.pi * 14
    above = np.polyadd([(w) ** 2, 0, (w * v) ** 2], [0.5 * v**2, 0, 0.5 * (w * v) ** 2])
    below = np.polymul([1, 0, w**2], [1, 0, v**2])
    A, B, C, _, _ = scipy.signal.cont2discrete(scipy.signal.tf2ss(above, below), DT)
    u = scipy.signal.chirp(DT * np.arange(150), 0.67, 1.49, 45)
    x, y = np.zeros(4), np.zeros(150)
    for k in range(150):
        y[k] = C[0] @ x
        x = A @ x + B[:, 0] * u[k]
    est = fq.fit(fq.OutputError(4, stable=True), fq.Record(u, y, DT))
    poles = np.sort(np.abs(np.angle(est.model.poles)))[::2]
    assert poles == pytest.approx([w * DT, v * DT], rel=1e-4)


def test_halves_of_what_is_stable_by_request_are_asked_for_the_same():
    # they were fitted without, and met modes that grow where the whole has none
    est = fq.fit(fq.OutputError(3, stable=True), growing(2))
    assert est.model.spec == fq.OutputError(3, stable=True)
    back = model_of_dict(json.loads(json.dumps(model_to_dict(est.model))))
    assert back.spec == est.model.spec
    for half in est.inquiry.apart(confirming(est.inquiry.readings)):
        assert np.abs(half.model.poles).max() <= 1


def test_a_pole_that_is_let_go_and_meets_the_circle_again_is_held():
    """It had not converged: a step inwards was predicted, and the minimum lay outside by 2e-7."""
    rng = np.random.default_rng(15)
    numerator, denominator, _ = scipy.signal.cont2discrete(([100.0], [1, 3.0, 0]), 0.01)
    u = np.sign(rng.standard_normal(400))
    y = scipy.signal.lfilter(numerator.ravel(), denominator, u)
    e = scipy.signal.lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], rng.standard_normal(600))[200:]
    data = fq.Record(u, y + 0.01 * y.std() * e, 0.01, hold="zoh")
    est = fq.fit(fq.OutputError(2, stable=True), data)
    assert est.verdict.grade == "trust", est.verdict
    free = fq.fit(fq.OutputError(2), data)
    assert free.cost < est.cost < 1.001 * free.cost
    assert np.abs(est.model.poles).max() < 1
