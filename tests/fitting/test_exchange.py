"""Black boxes out of a minimum in which a mode is missed, and how far responses are from them."""

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.black_box.exchange import exchanged
from freqid.fitting.black_box.rational_lines import RationalLines
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.cost.box_distance import BoxDistance
from freqid.fitting.reading import Reading
from freqid.lti import ZeroOrderHold

W, ZETA, GAIN = (0.11, 0.38, 0.9), (0.006, 0.03, 0.05), (0.1, 0.35, 0.6)


def modes(w, z, g):
    """Modes side by side, g w²/(s² + 2 z w s + w²)."""
    n = 2 * len(w)
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for i in range(len(w)):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, w[i]], [-w[i], -2 * z[i] * w[i]]]
        B[2 * i + 1, 0], C[0, 2 * i] = g[i] * w[i], 1
    return A, B, C


def plant_of(count):
    A, B, C = modes(W[:count], ZETA[:count], GAIN[:count])
    return fq.GreyBox(lambda k: (A, k * B, C, None), [fq.Parameter("k", 1.0)])


def noisy(count, ratio, n, seed):
    rng = np.random.default_rng(seed)
    clean = fq.simulate(plant_of(count), rng.choice([-1.0, 1.0], n), 1.0)
    return clean.with_noise(clean.y.std() / ratio, seed=seed)


@pytest.mark.parametrize("count", [2, 3])
def test_a_mode_that_was_missed_takes_the_place_of_one_that_is_worth_less(count):
    """Begun from wide modes, in noise that half hides the narrow ones."""
    record = noisy(count, 1.5, 900, 4)
    lines, plane = lines_in_plane([Reading(record, record.hold)])
    rational = RationalLines(lines, False)
    poles = np.exp(np.linalg.eigvals(modes(W[:count], ZETA[:count], GAIN[:count])[0]))
    true = rational.below((poles - plane.a) / (1 - plane.a * poles))
    wrong = rational.below(np.repeat([0.2, -0.3, 0.5], 2)[: 2 * count].astype(complex) + 0.01)
    assert wrong.cost > 1.03 * true.cost
    assert exchanged(rational, wrong).cost <= true.cost * (1 + 1e-6)


def test_nothing_is_exchanged_at_the_least_minimum():
    record = noisy(2, 50.0, 900, 4)
    lines, plane = lines_in_plane([Reading(record, record.hold)])
    rational = RationalLines(lines, False)
    poles = np.exp(np.linalg.eigvals(modes(W[:2], ZETA[:2], GAIN[:2])[0]))
    true = rational.below((poles - plane.a) / (1 - plane.a * poles))
    assert exchanged(rational, true).cost == pytest.approx(true.cost, rel=1e-9)


def test_distance_from_a_black_box_is_what_its_own_cost_says():
    """Beside the cost of the black box next to its minimum, and its gradient by steps."""
    record = noisy(2, 20.0, 900, 7)
    box = Reference.of(plant_of(2), [Reading(record, record.hold)])
    omega = np.linspace(0.01, np.pi, 200)
    distance = BoxDistance(box.surroundings(omega), ZeroOrderHold(1.0))
    rng, R = np.random.default_rng(0), box.solution.point.jacobian
    for size in (0.01, 0.3):
        # so many standard errors away, in a direction of the cost's own
        step = np.linalg.pinv(R) @ rng.standard_normal(len(R)) * size * box.noise
        x = box.solution.x + step
        more = box.objective.point(x).cost - box.cost
        G, _ = box.chart.response(x, omega, None)
        rows = distance.error(G)
        assert rows @ rows == pytest.approx(more, rel=0.02)
    _, dG = box.chart.response(box.solution.x, omega, None)
    moved = [box.chart.response(box.solution.x + h, omega, None)[0] for h in 1e-6 * np.eye(len(dG))]
    at, slope = box.chart.response(box.solution.x, omega, None)[0], distance.relative(dG)
    for i, other in enumerate(moved):
        by_steps = (distance.error(other) - distance.error(at)) / 1e-6
        assert np.abs(by_steps - slope[i]).max() < 1e-4 * np.abs(slope).max()


@pytest.mark.study
@pytest.mark.parametrize("stable", [False, True])
def test_output_error_in_noise_ends_no_higher_than_from_the_true_poles(stable):
    """Two weak modes in noise as large as they are, 12 records."""
    lost = 0
    for seed in range(12):
        record = noisy(2, 1.0, 500, seed)
        lines, plane = lines_in_plane([Reading(record, record.hold)])
        rational = RationalLines(lines, False, stable)
        poles = np.exp(np.linalg.eigvals(modes(W[:2], ZETA[:2], GAIN[:2])[0]))
        true = rational.below((poles - plane.a) / (1 - plane.a * poles))
        est = fq.fit(fq.OutputError(4, stable=stable), record)
        lost += est.cost > true.cost * rational.sizes[0] ** 2 * (1 + 1e-3)
    # stable ones may not leave the circle on their way
    assert lost <= stable
