"""Records of a list whose channels come in another order, or not all of them."""

import numpy as np
import pytest

import freqid as fq


def plant(a, b):
    return [[-a, 0], [0, -b]], np.eye(2), [[a, 0.2 * b], [0.1 * a, b]], None


MODEL = fq.GreyBox(plant, [fq.Parameter("a", 5.0), fq.Parameter("b", 12.0)])
IN, OUT = ["torque", "force"], ["angle", "place"]


def record(seed, turned=False):
    u = np.column_stack([np.tile(fq.white_noise(100, seed=seed + i), 4) for i in (10, 20)])
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


def test_other_names_go_by_place():
    other = record(1)
    other = fq.Record(other.u, other.y, other.dt, input_names=["p", "q"])
    est = fq.fit(MODEL, [record(0), other])
    assert est["a"] == pytest.approx(5, rel=1e-6)
