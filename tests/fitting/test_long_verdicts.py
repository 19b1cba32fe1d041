"""Verdicts on long records: what a question costs, and that it answers as one of its own would."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.fitting.cost.evaluation import SpectralEvaluation
from freqid.fitting.cost.objective import Objective, Point
from freqid.fitting.search.descent import minimise
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Glance, score

DT = 0.05
MODE = fq.GreyBox(
    lambda w, z, g: ([[0, w], [-w, -2 * z * w]], [[0], [w * g]], [[1.0, 0]], None),
    [fq.Parameter("w", 2.0), fq.Parameter("z", 0.1), fq.Parameter("g", 1.0)],
)


def record(n, seed, level=0.1, pole=0.0, lacking=0.0):
    """A mode under white noise, one beside it that the model lacks, and noise of its own."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(n)
    y = fq.simulate(MODE, u, DT).y
    if lacking:
        y = y + lacking * fq.simulate(MODE.with_values(w=9.0, z=0.02), u, DT).y
    e = scipy.signal.lfilter([1.0], [1.0, -pole], rng.standard_normal(n + 300))[300:]
    return fq.Record(u, y + level * y.std() * e / e.std(), DT)


@pytest.fixture
def evaluations(monkeypatch):
    """How many lines each evaluation of the cost had."""
    counted, own = [], SpectralEvaluation.__init__

    def counting(self, experiment, realisation):
        counted.append(experiment.n_lines)
        own(self, experiment, realisation)

    monkeypatch.setattr(SpectralEvaluation, "__init__", counting)
    return counted


@pytest.mark.parametrize("seed", [3, 5, 6])
def test_a_verdict_on_good_data_asks_all_lines_a_few_times_only(evaluations, seed):
    # a black box with a mode more followed a valley of the noise: 38, 28 and 27 evaluations
    n = 100_000
    est = fq.fit(MODE, record(n, seed))
    evaluations.clear()
    assert est.verdict.grade == "trust"
    whole = sum(lines > n // 4 for lines in evaluations)
    assert 0 < whole <= 20


def test_a_mode_that_long_records_show_plainly_is_still_named():
    est = fq.fit(MODE, record(100_000, 4, lacking=0.01))
    named = {w.kind: w.p_value for w in est.warnings}
    assert named["another mode"] < 1e-12


class Valley:
    """Rosenbrock's, of any height: 100 (y − x²)² + (1 − x)² + height."""

    def __init__(self, height):
        self.height = height

    def rows(self, x):
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0], np.sqrt(self.height)])

    def slopes(self, x):
        return np.array([[-20 * x[0], -1.0, 0.0], [10.0, 0.0, 0.0]])


class Descending(Objective):
    """A cost given by its rows."""

    def __init__(self, valley):
        self.valley = valley
        self.structure = type("Free", (), {
            "lower": np.full(2, -np.inf), "upper": np.full(2, np.inf),
            "realise": staticmethod(lambda x: x), "describe": staticmethod(str),
        })()  # fmt: skip
        super().__init__(self.structure, [])

    def _compute(self, x):
        rows = np.vstack([self.valley.slopes(x), self.valley.rows(x)]).T
        R = np.linalg.qr(rows, mode="r")
        return Point(R, [], [float(R[:, -1] @ R[:, -1])])


@pytest.mark.parametrize("height", [0.0, 1.0, 30.0])
def test_a_way_down_is_left_where_it_will_not_come_below_what_it_is_worth(height):
    start = np.array([-1.2, 1.0])
    whole = Descending(Valley(height))
    end = minimise(whole, start)
    assert end.converged
    assert end.cost == pytest.approx(height, abs=1e-9)
    # a goal below the minimum is given up, one above it never is
    hopeless, within = Descending(Valley(height)), Descending(Valley(height))
    left = minimise(hopeless, start, worth=height - 1.0)
    assert not left.converged
    assert hopeless.n_evaluations < whole.n_evaluations
    assert left.cost <= Valley(height).rows(start) @ Valley(height).rows(start)
    reached = minimise(within, start, worth=height + 0.01)
    assert reached.converged
    assert reached.cost == pytest.approx(height, abs=1e-9)


def seen_in(n):
    est = fq.fit(MODE, record(n, 5))
    return Scene.of(est.minimum, est.inquiry.readings).seen[0]


@pytest.mark.parametrize("n", [500, 501])
def test_lines_of_pulses_and_waves_are_those_of_their_transforms(n):
    s = seen_in(n)
    N, at = s.grid
    for samples in ([0], [3, N - 1], [N // 2], list(range(7, 20))):
        signal = np.zeros(N)
        signal[samples] = 1
        expected = np.fft.rfft(signal)[at]
        np.testing.assert_allclose(s.lines_of_pulses(np.array(samples)), expected, atol=1e-11)
    t = np.arange(N)
    for line in (4.0, 4.3, 17.0 + 1e-9, N / 2 - 1.5, N / 2):
        for found, wave in zip(s.lines_of_wave(line), (np.cos, np.sin), strict=True):
            expected = np.fft.rfft(wave(2 * np.pi * line / N * t))[at]
            np.testing.assert_allclose(found, expected, atol=1e-9 * N)


@pytest.mark.parametrize("pole", [0.0, 0.9])
@pytest.mark.parametrize("size", [0.0, 0.02, 0.5])
def test_a_glance_overlooks_nothing_that_weights_of_its_own_show(pole, size):
    # a suspect of few lines, one of many, one that noise hides where it is strong
    data = record(20_000, 6, pole=pole)
    t = np.arange(20_000) * DT
    shapes = {
        "tone": np.cos(7.0 * t),
        "step": (t > 400.0) * 1.0,
        "chirp": scipy.signal.chirp(t, 0.1, t[-1], 9.0),
    }
    for name, shape in shapes.items():
        y = data.y + size * data.y.std() * shape
        est = fq.fit(MODE, fq.Record(data.u, y, DT))
        scene = Scene.of(est.minimum, est.inquiry.readings)
        drawn = Columns([scene.seen[0].sampled(shape[None, None])])
        own, seen = (score(scene, drawn, np.ones(3), g) for g in (None, Glance(scene)))
        assert own.gain == pytest.approx(seen.gain)
        assert (own.p_value < 0.01) == (seen.p_value < 0.01), name
        if own.p_value < 0.01:
            assert own.p_value == pytest.approx(seen.p_value)
