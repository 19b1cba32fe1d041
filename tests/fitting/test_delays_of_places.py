"""Carts of several loads behind a delay: each load has its own black box behind it, too."""

import pytest

import freqid as fq

DT, N = 5e-3, 1200
TRUTH = {"m": 1.0, "d": 3.0, "k": 400.0, "Td": 0.013}


def cart(**more):
    def matrices(m, d, k, load):
        M = m + load
        return [[0, 1], [-k / M, -d / M]], [[0], [1 / M]], [[0, 1]], None

    parameters = [fq.Parameter(n, v, lower=0) for n, v in TRUTH.items() if n != "Td" or more]
    return fq.GreyBox(matrices, parameters, conditions={"load": 0.0}, **more)


def records(seed, noise=0.05, own=False):
    """White forces on three loads; where the delay is each one's ``own`` it is said with them."""
    for i, load in enumerate((0.0, 0.5, 1.0)):
        said = {"Td": 0.013 + 0.011 * i} if own else {}
        plant = cart(input_delay="Td").with_conditions(load=load)
        u = fq.white_noise(N, seed=10 * seed + i)
        r = fq.simulate(plant.with_values(**said), u, DT)
        yield r.with_noise(noise * r.y.std(), seed=10 * seed + i).with_conditions(load=load, **said)


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_a_right_model_is_trusted(seed):
    """One black box stood beside all loads as if they were one: half of these were doubted."""
    est = fq.fit(cart(input_delay="Td"), records(seed))
    assert est.verdict.trusted
    # three boxes of two states and a direct term share the delay with the plant's four unknowns
    assert est.witness.degrees[0] == 3 * 5 - 4


def test_delays_that_the_records_say_differ():
    est = fq.fit(cart(input_delay="Td"), records(3, own=True))
    assert est.witness.verdict == "complete"
    assert est.verdict.trusted
    assert est.witness.degrees[0] == 3 * 5 - 3


def test_a_delay_that_is_left_out_is_named():
    est = fq.fit(cart(), records(4))
    assert est.suspects.index[0] == "delay"
    assert not est.verdict.trusted
