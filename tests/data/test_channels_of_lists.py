"""Records of a list whose channels come in another order, or not all of them."""

import numpy as np
import pytest

import freqid as fq


def plant(a, b):
    return [[-a, 0], [0, -b]], np.eye(2), [[a, 0.2 * b], [0.1 * a, b]], None


MODEL = fq.GreyBox(plant, [fq.Parameter("a", 5.0), fq.Parameter("b", 12.0)])
IN, OUT = ["torque", "force"], ["angle", "place"]


def record(seed, turned=False, periods=4):
    noise = [fq.white_noise(400 // periods, seed=seed + i) for i in (10, 20)]
    u = np.column_stack([np.tile(each, periods) for each in noise])
    one = fq.simulate(MODEL, u, 0.02)
    one = fq.Record(one.u, one.y, one.dt, input_names=IN, output_names=OUT)
    return one.select(IN[::-1], OUT[::-1]) if turned else one


@pytest.mark.parametrize(
    "estimate",
    [
        lambda sets: fq.h1(sets, segment=80),
        fq.etfe,
        lambda sets: fq.periodic([s.slice(0, 4) for s in sets], period=2),
    ],
    ids=["h1", "etfe", "periodic"],
)
def test_estimates_take_channels_by_name(estimate):
    """They took them by place: gains off by factors, d -350 %, and no word."""
    same = estimate([record(0), record(1)])
    turned = estimate([record(0), record(1, turned=True)])
    assert list(turned.input_names) == IN
    np.testing.assert_allclose(turned.response, same.response, rtol=1e-12)


def test_a_model_without_names_takes_those_of_the_first():
    est = fq.fit(MODEL, [record(0), record(1, turned=True)])
    assert est["a"] == pytest.approx(5, rel=1e-6)
    assert est["b"] == pytest.approx(12, rel=1e-6)


def test_a_name_at_another_place_is_refused():
    other = record(1)
    other = fq.Record(other.u, other.y, other.dt, input_names=["force", "x"], output_names=OUT)
    with pytest.raises(ValueError, match=r"data\[1\] has input_names.*'force' stands at another"):
        fq.fit(MODEL, [record(0), other])
    with pytest.raises(ValueError, match=r"records\[1\] has input_names"):
        fq.h1([record(0), other], segment=80)
    named = fq.GreyBox(plant, MODEL.parameters, inputs=IN, outputs=OUT)
    with pytest.raises(ValueError, match="'force' would be taken for 'torque'"):
        fq.fit(named, other)


def test_a_channel_in_a_multiple_of_the_firsts_unit_is_refused():
    """Its numbers were taken for those of the first: a mass of 0.004 for 2."""

    def measured(seed, unit, factor):
        r = record(seed)
        return fq.Record(r.u, r.y * [factor, 1], r.dt, input_names=IN, output_names=OUT,
                         units={"angle": unit})  # fmt: skip

    one = measured(0, "m/s^2", 1.0)
    other = measured(1, "mm/s^2", 1e3)
    for estimate in (lambda sets: fq.fit(MODEL, sets), lambda sets: fq.h1(sets, segment=80)):
        with pytest.raises(ValueError, match=r"\[1\] has 'angle' in mm/s\^2 and the first in m/s"):
            estimate([one, other])
        # however it is written, and what is in no unit that is known, is taken as it is
        estimate([one, measured(1, "m/s²", 1.0)])
        estimate([one, measured(1, "", 1.0)])


def test_other_names_go_by_place():
    other = record(1)
    other = fq.Record(other.u, other.y, other.dt, input_names=["p", "q"])
    est = fq.fit(MODEL, [record(0), other])
    assert est["a"] == pytest.approx(5, rel=1e-6)


@pytest.mark.parametrize("estimate", [fq.local_polynomial, lambda s: fq.h1(s, segment=80)])
def test_a_turned_response_keeps_what_it_knows_of_its_noise(estimate):
    """How lines share their noise was lost, and standard errors were five times other ones."""
    sets = [record(seed, periods=1).with_noise(0.02, seed=seed) for seed in range(3)]
    turned = [s.select(IN[::-1], OUT[::-1]) for s in sets]
    named = fq.GreyBox(plant, MODEL.parameters, inputs=IN, outputs=OUT)
    one, other = (fq.fit(named, estimate(s)) for s in (sets, turned))
    np.testing.assert_allclose(other.values, one.values, rtol=1e-6)
    np.testing.assert_allclose(other.parameters["std"], one.parameters["std"], rtol=1e-4)
    assert [w.kind for w in other.warnings] == [w.kind for w in one.warnings]
