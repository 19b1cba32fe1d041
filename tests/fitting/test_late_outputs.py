"""One of several outputs that comes late or early, as over another bus."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, N = 1e-3, 1500
TRUE = {"R": 1.2, "L": 3e-3, "K": 0.05, "J": 2e-4, "b": 1e-4}
NAMES = ["current", "speed"]


def matrices(R, L, K, J, b):
    return [[-R / L, -K / L], [K / J, -b / J]], [[1 / L], [0]], [[1, 0], [0, 1]], None


MOTOR = fq.GreyBox(matrices, [fq.Parameter(n, v) for n, v in TRUE.items()], outputs=NAMES)


def measured(kind, seed, late):
    """A motor by scipy, with each output so many samples late."""
    rng = np.random.default_rng(seed)
    u = (
        fq.chirp(1, 100, N * DT, DT)
        if kind == "chirp"
        else np.repeat(rng.choice([-1, 1], N // 20), 20)
    )
    A, B, C = (np.array(M, float) for M in matrices(**TRUE)[:3])
    step = scipy.signal.cont2discrete((A, B, C, np.zeros((2, 1))), DT)[:4]
    y = scipy.signal.dlsim((*step, DT), 6.0 * u)[1]
    y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    y = np.column_stack([np.roll(x, q) for x, q in zip(y.T, late, strict=True)])
    return fq.Record(6 * u[10:-10], y[10:-10], DT, output_names=NAMES)


@pytest.mark.study
@pytest.mark.parametrize("weights", [None, "noise"])
@pytest.mark.parametrize(
    ("kind", "late"),
    [("prbs", (0, 3)), ("prbs", (0, -1)), ("chirp", (0, 5)), ("chirp", (3, 0)), ("prbs", (1, 0))],
)
def test_one_output_that_is_late_is_named_with_its_samples(kind, late, weights):
    """These were "feedthrough", "another mode", "unsteady" or a delay of the input."""
    est = fq.fit(MOTOR, measured(kind, 1, late), weights=weights, n_starts=1)
    found = est.warnings[0]
    assert found.kind == "delay"
    output = int(late[1] != 0)
    q = late[output]
    rows = f"{abs(q)} sample{'s' if abs(q) > 1 else ''} {'late' if q > 0 else 'early'}"
    assert f"output {NAMES[output]!r}" in found
    assert f"logged {rows}" in found
    assert found.number == pytest.approx(q * DT)
    assert not est.verdict.trusted


@pytest.mark.parametrize("late", [(0, 0), (2, 2)])
def test_outputs_that_go_together_are_not(late):
    est = fq.fit(MOTOR, measured("prbs", 2, late), n_starts=1)
    assert est.verdict.trusted == (late == (0, 0))
    assert not any(w.startswith("delay: output") for w in est.warnings)


COIL = {"R": 4.0, "L": 1e-3, "K": 8.0, "m": 0.15, "c": 2.0, "k": 3000.0}


def coil(R, L, K, m, c, k):
    A = [[-R / L, 0, -K / L], [0, 0, 1], [K / m, -k / m, -c / m]]
    return A, [[1 / L], [0], [0]], [[0, 1, 0], [1, 0, 0]], None


@pytest.mark.parametrize("seed", [0])
def test_a_late_input_is_no_late_output(seed):
    """The dead time of a drive, of which a position shows little, was the current's logger's."""
    dt, count, fine = 2e-4, 2500, 4
    u = 5 * scipy.signal.chirp(np.arange(count) * dt, 5, count * dt, 400)
    A, B, C = (np.array(M, float) for M in coil(**COIL)[:3])
    step = scipy.signal.cont2discrete((A, B, C, np.zeros((2, 1))), dt / fine)[:4]
    # a sample and a half: six of the finer steps
    late = np.concatenate([np.zeros(6), np.repeat(u, fine)])[: fine * count]
    y = scipy.signal.dlsim((*step, dt / fine), late)[1][::fine]
    y += 0.02 * y.std(axis=0) * np.random.default_rng(seed).standard_normal(y.shape)
    begun = zip(COIL, COIL.values(), [0.5, 2, 0.6, 2, 3, 0.7], strict=True)
    plant = fq.GreyBox(coil, [fq.Parameter(n, f * v) for n, v, f in begun], outputs=["x", "i"])
    found = fq.fit(plant, fq.Record(u, y, dt, output_names=["x", "i"]), weights="noise").warnings[0]
    assert found.kind == "delay"
    assert "the input acts" in found
    assert found.number == pytest.approx(1.5 * dt, abs=0.6 * dt)
