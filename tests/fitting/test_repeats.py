"""Experiments at the same lines go together: the same cost, derivatives and initial states."""

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.cost import repeats
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.places import places_of
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.noise_models import GivenWeights
from freqid.fitting.reading import Reading

PLANT = fq.two_mass()
DELAYED = fq.GreyBox(
    lambda a, b, Td: ([[-a]], [[b]], [[1.0]], [[0.3]]),
    [fq.Parameter("a", 20.0), fq.Parameter("b", 50.0), fq.Parameter("Td", 0.012, unit="s")],
    input_delay="Td",
)


def two_outputs(k, c):
    """A mass on a spring, seen by its position and its acceleration."""
    return [[0, 1], [-k, -c]], [[0], [1]], [[1, 0], [-k, -c]], [[0], [1]]


OSCILLATOR = fq.GreyBox(two_outputs, [fq.Parameter("k", 900.0), fq.Parameter("c", 2.0)])


def repeated(plant, dt, count=4, samples=300, levels=(0.02,)):
    """Records of one plant, which begin in motion, with noise of these levels in turn."""
    rng = np.random.default_rng(5)
    made = []
    for i in range(count):
        r = fq.simulate(plant, rng.standard_normal(samples + 40), dt)
        noise = levels[i % len(levels)] * r.y.std(axis=0)
        made.append(r.with_noise(noise, seed=i).slice(40 * dt, (samples + 40) * dt))
    return made


def lines_of(records, **options):
    return [Reading.of(r, place=i, **options).lines() for i, r in enumerate(records)]


def weighted(records):
    """Lines of records with weights of their own, unlike from one output to the next."""
    made = []
    for i, r in enumerate(records):
        own = np.random.default_rng(i).uniform(0.5, 2, (r.n_outputs, r.n_samples // 2 + 1))
        made.append(Reading.of(r, noise=GivenWeights(own), place=i).lines())
    return made


AXIS = repeated(PLANT, 1e-3)
OUTPUTS = repeated(OSCILLATOR, 0.01)
CASES = {
    "repeats": (PLANT, lines_of(AXIS)),
    "in a band": (PLANT, lines_of(AXIS, band=(5, 100))),
    "weights of their own": (PLANT, weighted(AXIS)),
    "of two outputs": (OSCILLATOR, weighted(OUTPUTS)),
    "two outputs": (OSCILLATOR, lines_of(OUTPUTS)),
    "slower outputs": (PLANT, lines_of([r.decimate(5, keep_input=True) for r in AXIS])),
    "a wrong hold": (PLANT, lines_of([r.decimate(5) for r in AXIS], hold="foh")),
    "from rest": (PLANT, lines_of(AXIS, initial_state="steady")),
    "offsets": (OSCILLATOR, [e.with_offsets(300) for e in lines_of(OUTPUTS)]),
    "behind a delay": (DELAYED, lines_of(repeated(DELAYED, 0.005), delayed=True)),
    "responses": (PLANT, [Reading.of(fq.etfe(r), place=i).lines() for i, r in enumerate(AXIS)]),
    "of two lengths": (PLANT, lines_of([AXIS[0], AXIS[1].slice(0, 0.2), AXIS[2], AXIS[3]])),
}


def evaluations(monkeypatch):
    """Numbers of channels of each evaluation that is made from now on."""
    made = []

    class Counted(repeats.SpectralEvaluation):
        def __init__(self, experiment, realisation):
            made.append(experiment.lines.U.shape[1])
            super().__init__(experiment, realisation)

    monkeypatch.setattr(repeats, "SpectralEvaluation", Counted)
    return made


@pytest.mark.parametrize("name", CASES)
def test_costs_are_those_of_each_alone(name):
    plant, experiments = CASES[name]
    structure = GreyStructure(plant)
    assert_together_as_alone(structure, experiments)


def assert_together_as_alone(structure, experiments):
    x = structure.start * np.random.default_rng(0).uniform(0.9, 1.1, len(structure.start))
    whole = Objective(structure, experiments).point(x)
    alone = [Objective(structure, [e]).point(x) for e in experiments]
    assert whole.parts == pytest.approx([p.cost for p in alone], rel=1e-10)
    squares = sum(p.triangle.T @ p.triangle for p in alone)
    size = np.sqrt(np.diag(squares))
    off = (whole.triangle.T @ whole.triangle - squares) / np.outer(size, size)
    assert np.abs(off).max() < 1e-9
    for own, single in zip(whole.initial, alone, strict=True):
        if single.initial[0] is None:
            assert own is None
        else:
            np.testing.assert_allclose(own, single.initial[0], rtol=1e-6, atol=1e-9)


def test_they_take_one_evaluation(monkeypatch):
    made = evaluations(monkeypatch)
    structure = GreyStructure(PLANT)
    Objective(structure, CASES["repeats"][1]).point(structure.start)
    assert made == [4]


def test_only_what_meets_the_same_plant_goes_together(monkeypatch):
    def lever(J, k, load=0.0):
        return [[0, 1], [-k / (J + load), -3.0]], [[0], [1 / (J + load)]], [[1.0, 0]], None

    plant = fq.GreyBox(
        lever, [fq.Parameter("J", 0.5), fq.Parameter("k", 400.0)], conditions={"load": 0.0}
    )
    loads = [0.0, 0.3, 0.0, 0.3]
    records = [
        r.with_conditions(load=load) for r, load in zip(repeated(plant, 0.01), loads, strict=True)
    ]
    places, _ = places_of(plant, records, ())
    structure = PlacedStructure(plant, None, places)
    made = evaluations(monkeypatch)
    experiments = lines_of(records)
    Objective(structure, experiments).point(structure.start)
    assert made == [2, 2]
    assert_together_as_alone(structure, experiments)
