"""Decimated records whose hold was forgotten: the paper's mistake on other plants and inputs.

What the input did between its samples looks like a loop (it goes with inputs still to come) and
like one more mode; neither is said before the hold.
"""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, FACTOR = 1e-3, 5


def motor():
    """Voltage to the speed of a motor; a load behind its gear and a soft coupling."""
    R, Kt, N = 1.2, 0.06, 15.0

    def matrices(L, Jm, bm, k, d, Jl):
        A = [
            [-R / L, -Kt / L, 0, 0],
            [Kt / Jm, -(bm + d / N**2) / Jm, -k / N / Jm, d / N / Jm],
            [0, 1 / N, 0, -1],
            [0, d / N / Jl, k / Jl, -d / Jl],
        ]
        return A, [[1 / L], [0], [0], [0]], [[0, 1.0, 0, 0]], None

    values = {"L": 1e-3, "Jm": 3e-5, "bm": 1e-4, "k": 15.0, "d": 0.05, "Jl": 5e-3}
    return fq.GreyBox(matrices, [fq.Parameter(n, v, lower=0) for n, v in values.items()])


TRUE = {"L": 2e-3, "Jm": 4e-5, "bm": 3e-4, "k": 25.0, "d": 0.02, "Jl": 8e-3}


def forgotten(plant, seed, jitter=0.17, n=1600, noise=0.02):
    """A chirp and a little white torque, held over DT; every fifth sample of both is logged."""
    rng = np.random.default_rng(seed)
    t = np.arange(n * FACTOR) * DT
    u = scipy.signal.chirp(t, 1, t[-1], 80) + jitter * rng.standard_normal(len(t))
    fast = fq.simulate(plant, u, DT)
    y = fast.y + noise * fast.y.std() * rng.standard_normal(fast.y.shape)
    return fq.Record(u[::FACTOR], y[::FACTOR], DT * FACTOR)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_the_hold_is_said_before_a_loop_and_one_more_mode(seed):
    est = fq.fit(motor(), forgotten(motor().with_values(**TRUE), seed))
    assert est.warnings[0].kind == "hold rejected"
    assert "feedback" not in [w.kind for w in est.warnings]
    assert est.verdict.grade == "do not use"


def test_a_loop_under_the_right_hold_is_still_a_loop():
    """A second-order plant under a proportional controller; its sensor's noise goes round.

    The controller answers a sample late, so that it is no direct term.
    """
    plant = fq.GreyBox(
        lambda w, z, g: ([[0, 1], [-w * w, -2 * z * w]], [[0], [g * w * w]], [[1.0, 0]], None),
        [fq.Parameter("w", 60.0, lower=0), fq.Parameter("z", 0.2, lower=0), fq.Parameter("g", 1.0)],
    )
    dt, gain = 5e-3, 0.6
    A, B, C, _ = plant.matrices(*plant.values.values())
    F, G, *_ = scipy.signal.cont2discrete([*map(np.asarray, (A, B, C)), np.zeros((1, 1))], dt)
    rng = np.random.default_rng(4)
    reference, noise = rng.standard_normal((2, 3000))
    x, u, y = np.zeros(2), np.zeros(3000), np.zeros(3000)
    for i in range(len(u)):
        u[i] = gain * (reference[i] - y[i - 1])
        y[i] = C[0] @ x + 0.3 * noise[i]
        x = F @ x + G[:, 0] * u[i]
    est = fq.fit(plant, fq.Record(u, y, dt))
    assert "feedback" in [w.kind for w in est.warnings]


@pytest.mark.study
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("fault", ["hold", "feedthrough"])
def test_what_one_unknown_of_a_linear_plant_explains_is_no_friction(fault, seed):
    """To a sweep through a lag the sign of the speed explains half of it: it was said first."""
    lag, dt, n = fq.first_order(b=50.0, a=20.0), 0.01, 1500
    u = fq.chirp(1, 30, n * dt, dt)
    clean = fq.simulate(lag, u, dt).y
    if fault == "hold":
        between = np.interp(np.arange(5 * n) / 5, np.arange(n), u)
        y = fq.simulate(lag, between, dt / 5).y[::5]
    else:
        y = clean + 0.1 * clean.std() / u.std() * u
    e = np.random.default_rng(seed).standard_normal(n)
    est = fq.fit(lag, fq.Record(u, y + 0.1 * clean.std() * e, dt))
    assert est.warnings[0].kind in ("hold rejected", "feedthrough")


@pytest.mark.parametrize("factor", [2, 5])
@pytest.mark.parametrize("seed", [50, 51])
def test_a_hold_is_named_beside_a_delay_of_the_plant(factor, seed):
    """A period and a delay cannot both be free, and no other hold was tried: "another mode" in 63
    of 64 records, the delay a tenth off.
    """

    def matrices(K, T):
        return [[-1 / T]], [[K / T]], [[1.0]], None

    true = {"K": 2.0, "T": 0.03, "Td": 0.0213}
    plant = fq.GreyBox(
        matrices, [fq.Parameter(n, v, lower=0) for n, v in true.items()], input_delay="Td"
    )
    n, high = 400 * factor, 0.35 / (DT * factor)
    u = fq.multisine((1 / (n * DT), high), n * DT, DT, seed=seed)
    clean = fq.simulate(plant, u, DT)
    fast = clean.with_noise(0.02 * clean.y.std(), seed=seed)
    slow = fq.Record(fast.u[::factor], fast.y[::factor], DT * factor)
    start = {n: v * f for (n, v), f in zip(true.items(), (1.2, 0.8, 0.9), strict=True)}
    est = fq.fit(plant, slow, start=start)
    assert est.warnings[0].kind == "hold rejected", est.warnings
    held = fq.fit(plant, slow, start=start, hold=fq.ZeroOrderHold(DT))
    assert held.verdict.trusted
    assert held["Td"] == pytest.approx(true["Td"], rel=0.01)


def tanks(C1, C2, k12, h1, h2):
    """Temperatures of two tanks that share heat, one of them heated."""
    A = [[-(k12 + h1) / C1, k12 / C1], [k12 / C2, -(k12 + h2) / C2]]
    return A, [[1 / C1], [0]], [[1, 0], [0, 1]], None


@pytest.mark.study
@pytest.mark.parametrize("name", ["white", "steps", "chirp"])
@pytest.mark.parametrize("seed", range(3))
def test_straight_lines_where_steps_are_true_are_the_hold(name, seed):
    """Half a sample late: "delay" had been said of 7 of 7 of them, which lines do not go with."""
    values = {"C1": 500.0, "C2": 800.0, "k12": 5.0, "h1": 1.0, "h2": 2.0}
    model = fq.GreyBox(tanks, [fq.Parameter(n, v) for n, v in values.items()])
    rng = np.random.default_rng(seed)
    u = {
        "white": rng.standard_normal(1000),
        "steps": np.repeat(rng.standard_normal(100), 10),
        "chirp": fq.chirp(1e-3, 0.05, 5000, 5.0)[:1000],
    }[name]
    clean = fq.simulate(model, 50 * u, 5.0)
    noisy = clean.y + 0.01 * clean.y.std(axis=0) * rng.standard_normal(clean.y.shape)
    said = fq.fit(model, fq.Record(50 * u, noisy, 5.0, hold="foh")).verdict.reasons[0]
    assert said.startswith("hold rejected: the data contradict FirstOrderHold(period=5.0)")
    assert "a zero-order hold of about" in said
