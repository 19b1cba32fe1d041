"""An input that is lost beside a constant of the output, or is not heard at all."""

import numpy as np

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
