"""An input that is lost beside a constant of the output, or is not heard at all."""

import numpy as np
import pytest
import scipy

import freqid as fq


def resonant(J, d, k):
    return [[0, 1], [-k / J, -d / J]], [[0], [1 / J]], [[1, 0]], None


MODEL = fq.GreyBox(
    resonant, [fq.Parameter("J", 0.6), fq.Parameter("d", 1.2), fq.Parameter("k", 250.0)]
)


def strangers(constant):
    u, y = (np.random.default_rng(seed).standard_normal(300) for seed in (0, 1))
    return fq.Record(u, y + constant, 0.01)


def test_a_constant_is_said_before_an_input_is_called_unheard():
    """Outputs of several standard deviations of offset: "no signal", and "check the channels"."""
    beside = fq.fit(MODEL, strangers(3.0))
    assert beside.verdict.reasons[0].startswith("offset: 90.8 % of the power of y is a constant")
    assert not beside.verdict.trusted
    # with it free, and without it, the input is not heard
    for est in (fq.fit(MODEL, strangers(3.0), offset="estimate"), fq.fit(MODEL, strangers(0.0))):
        assert est.verdict.grade == "do not use"
        assert est.verdict.reasons[0].startswith("no signal")


@pytest.mark.parametrize("constant", [1e3, 1e7])
def test_a_constant_that_is_estimated_explains_nothing(constant):
    """Found: pure noise 99.9 % explained, a missing mode trusted, another minimum, "no signal"."""
    two = fq.TransferFunction(1, 2)
    A = scipy.linalg.block_diag([[0, 1], [-100, -0.4]], [[0, 1], [-900, -1.5]])
    plant = fq.GreyBox(
        lambda g: (A, [[0], [g], [0], [g]], [[1, 0, 0.8, 0]], [[0]]), [fq.Parameter("g", 1.0)]
    )
    u = np.random.default_rng(1).standard_normal(2000)
    record = fq.simulate(plant, u, 2e-2).with_noise(1e-3)
    moved = fq.Record(record.u, record.y + constant * record.y.std(), record.dt)
    for model, grade in ((plant, "trust"), (two, "doubt"), (fq.OutputError(2), "doubt")):
        here, there = (fq.fit(model, r, offset="estimate") for r in (record, moved))
        assert (here.verdict.grade, there.verdict.grade) == (grade, grade)
        assert [w.kind for w in there.warnings] == [w.kind for w in here.warnings]
        assert there.cost == pytest.approx(here.cost, rel=1e-4)
        assert there.fit_percent == pytest.approx(here.fit_percent, abs=1e-3)
        assert fq.compare(there, moved).fit_percent[0] == pytest.approx(here.fit_percent, abs=0.5)
    told = float(fq.fit(plant, moved, offset="estimate").notes[0].rpartition(" ")[2])
    assert told == pytest.approx(constant * record.y.std(), rel=1e-3)
