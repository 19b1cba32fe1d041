"""Plants with several inputs and outputs: a fault of one channel is said of that channel."""

import re

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

import freqid as fq

DT, N = 5e-3, 1500
TRUE = {"m1": 1.0, "m2": 0.6, "k1": 900.0, "k2": 500.0, "d1": 2.0, "d2": 1.0}


def axes(m1, m2, k1, k2, d1, d2):
    """Two masses in a row, one sprung to the ground, a force on each: angle 1 and speed 2."""
    A = [[0, 0, 1, 0], [0, 0, 0, 1],
         [-(k1 + k2) / m1, k2 / m1, -(d1 + d2) / m1, d2 / m1],
         [k2 / m2, -k2 / m2, d2 / m2, -d2 / m2]]  # fmt: skip
    B = [[0, 0], [0, 0], [1 / m1, 0], [0, 1 / m2]]
    return A, B, [[1, 0, 0, 0], [0, 0, 0, 1]], [[0, 0], [0, 0]]


def plant(off=1.1, unit=1.0):
    def seen(**values):
        A, B, C, D = axes(**values)
        return A, B, [C[0], [unit * c for c in C[1]]], D

    return fq.GreyBox(
        lambda m1, m2, k1, k2, d1, d2: seen(m1=m1, m2=m2, k1=k1, k2=k2, d1=d1, d2=d2),
        [fq.Parameter(n, v * off, lower=0) for n, v in TRUE.items()],
        inputs=["force 1", "force 2"], outputs=["angle", "speed"],
    )  # fmt: skip


def measured(seed, unit=1.0, noise=0.02):
    """Inputs and outputs by the matrix exponential, each output with noise of its own size."""
    rng = np.random.default_rng(seed)
    A, B, C, _ = (np.array(M, float) for M in axes(**TRUE))
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((2, 6))]]) * DT)
    u, x, y = rng.standard_normal((N, 2)), np.zeros(4), np.empty((N, 2))
    for i in range(N):
        y[i] = C @ x
        x = step[:4, :4] @ x + step[:4, 4:] @ u[i]
    y = y * [1, unit]
    return u, y + noise * y.std(axis=0) * rng.standard_normal(y.shape)


def record(u, y):
    names = {"input_names": ["force 1", "force 2"], "output_names": ["angle", "speed"]}
    return fq.Record(u, y, DT, **names)


def with_offset(y, o):
    y[:, o] += 0.5 * y[:, o].std()


def with_a_drift(y, o):
    y[:, o] += np.linspace(-1, 1, N) * y[:, o].std()


def with_a_spike(y, o):
    y[700, o] += 8 * y[:, o].std()


def with_hum(y, o):
    y[:, o] += 0.5 * y[:, o].std() * np.sin(2 * np.pi * 33.3 * DT * np.arange(N))


def at_a_limit(y, o):
    y[:, o] = np.clip(y[:, o], -1.6 * y[:, o].std(), 1.6 * y[:, o].std())


@pytest.mark.study
@pytest.mark.parametrize(
    ("fault", "kind"),
    [(with_a_spike, "spikes"), (with_offset, "offset"), (with_a_drift, "drift"),
     (with_hum, "tone"), (at_a_limit, "saturation")],
)  # fmt: skip
@pytest.mark.parametrize("o", [0, 1])
def test_the_output_is_named(fault, kind, o):
    u, y = measured(o)
    # outputs that count alike
    sizes = y.std(axis=0)
    fault(y, o)
    said = fq.fit(scaled(sizes), record(u, y / sizes)).warnings
    told = next(w for w in said if w.kind == kind)
    assert f"output '{('angle', 'speed')[o]}'" in told


def scaled(sizes):
    model = plant()

    def matrices(m1, m2, k1, k2, d1, d2):
        A, B, C, D = axes(m1, m2, k1, k2, d1, d2)
        return A, B, [[c / s for c in row] for row, s in zip(C, sizes, strict=True)], D

    return fq.GreyBox(
        matrices, model.parameters, inputs=list(model.inputs), outputs=list(model.outputs)
    )


def test_of_one_output_nothing_is_named():
    lag = fq.first_order()
    made = fq.simulate(lag, fq.white_noise(1000, seed=1), 0.01).with_noise(0.01, seed=2)
    est = fq.fit(lag, fq.Record(made.u, made.y + 0.1, 0.01))
    assert str(est.warnings[0]).startswith("offset: an output has a constant of ")


GAINS = [
    ("input", 1, 1.2, None), ("output", 1, 1.2, "noise"), ("input", 0, 1.1, None),
    ("output", 1, 0.9, "noise"), ("output", 0, 1.5, None),
]  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize(("channel", "number", "factor", "weights"), GAINS)
def test_a_wrong_gain_lacks_no_mode(channel, number, factor, weights):
    """It was "another mode" or "structure". One of two scales is only known beside the other."""
    is_named(channel, number, factor, weights)


@pytest.mark.study
@pytest.mark.parametrize(("channel", "number", "factor", "other"), GAINS)
def test_a_wrong_gain_is_named_by_other_weights(channel, number, factor, other):
    is_named(channel, number, factor, None if other else "noise")


def is_named(channel, number, factor, weights):
    u, y = measured(3)
    (u if channel == "input" else y)[:, number] *= factor
    est = fq.fit(plant(), record(u, y), weights=weights)
    assert est.warnings[0].kind == "scale"
    name = {"input": ["force 1", "force 2"], "output": ["angle", "speed"]}[channel][number]
    said = re.search(rf"{channel} '{name}' is ([0-9.]+) times as large", est.warnings[0])
    assert said, est.warnings[0]
    assert float(said[1]) == pytest.approx(factor, rel=0.02)
    assert est.verdict.grade != "trust"


@pytest.mark.parametrize(("factor", "number"), [(180 / np.pi, 0), (180 / np.pi, 1), (1.05, 1)])
def test_an_axis_whose_angle_is_in_degrees_is_told_the_factor(factor, number):
    model = fq.GreyBox(
        lambda J, d, k: ([[0, 1.0], [-k / J, -d / J]], [[0], [1 / J]], [[1, 0], [0, 1.0]], None),
        [fq.Parameter("J", 0.12, lower=0), fq.Parameter("d", 0.6, lower=0),
         fq.Parameter("k", 45.0, lower=0)],
        inputs=["torque"], outputs=["angle", "speed"],
    )  # fmt: skip
    u = fq.chirp(0.5, 20, 10, DT)
    y = fq.simulate(model.with_values(J=0.1, d=0.5, k=40.0), u, DT).y.copy()
    y[:, number] *= factor
    y += 0.02 * y.std(axis=0) * np.random.default_rng(1).standard_normal(y.shape)
    names = {"input_names": ["torque"], "output_names": ["angle", "speed"]}
    est = fq.fit(model, fq.Record(u, y, DT, **names))
    assert est.warnings[0].kind == "scale"
    name = ("angle", "speed")[number]
    said = re.search(rf"output '{name}' is ([0-9.]+) times as large", est.warnings[0])
    assert said, est.warnings[0]
    assert float(said[1]) == pytest.approx(factor, rel=0.02)
    assert ("(degrees for radians)" in est.warnings[0]) == (factor > 50)
    # either channel may be the wrong one, and which makes a factor of 57 in all that is found
    assert ("no data tell which" in est.warnings[0]) == (", or output" in est.warnings[0])
    assert est.verdict.grade != "trust"


@pytest.mark.study
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_the_witness_counts_the_output_that_outweighs_the_others(unit):
    """F was twice too large where one output carries all that is left: 5 of 50 were doubted."""
    p = []
    for seed in range(30):
        u, y = measured(100 + seed, unit)
        est = fq.fit(plant(unit=unit), record(u, y), n_starts=1)
        p.append(est.witness.p_value)
    assert scipy.stats.kstest(p, "uniform").pvalue > 0.01
    assert min(p) > 1e-3


@pytest.mark.study
@pytest.mark.parametrize("side", ["inputs 'force 1' and 'force 2'", "outputs 'angle' and 'speed'"])
def test_two_channels_exchanged_are_named(side):
    """They were another mode, and a doubt only, with parameters 84 to 89 % off."""
    u, y = measured(1)
    u, y = (u[:, ::-1], y) if side.startswith("inputs") else (u, y[:, ::-1])
    est = fq.fit(plant(), record(u.copy(), y.copy()), n_starts=2)
    assert est.warnings[0].kind == "swapped channels"
    assert f"{side} are exchanged" in est.warnings[0]
    assert est.verdict.grade == "do not use"
