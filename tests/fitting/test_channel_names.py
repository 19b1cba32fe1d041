"""Channels are known by their names, where plant and data both have them."""

import dataclasses

import numpy as np
import pytest

import freqid as fq


def matrices(a1, b1, a2, b2):
    return [[-a1, 3], [-2, -a2]], [[b1, 0], [0, b2]], [[1, 0], [0, 1]], None


VALUES = {"a1": 20.0, "b1": 50.0, "a2": 40.0, "b2": 10.0}
ARM = fq.GreyBox(
    matrices, [fq.Parameter(n, v) for n, v in VALUES.items()],
    inputs=["shoulder", "elbow"], outputs=["qs", "qe"],
)  # fmt: skip
RECORD = fq.simulate(
    ARM, np.column_stack([fq.white_noise(1500, seed=s) for s in (1, 2)]), 5e-3,
    input_names=["shoulder", "elbow"], output_names=["qs", "qe"],
)  # fmt: skip


def near(est):
    return max(abs(est[n] / v - 1) for n, v in VALUES.items())


def test_another_order_is_put_in_order():
    turned = RECORD.select(["elbow", "shoulder"], ["qe", "qs"])
    est = fq.fit(ARM, [RECORD, turned], start={"a1": 15})
    assert near(est) < 1e-8
    for record in (RECORD, turned):
        assert (fq.compare(est, record).fit_percent > 99.99).all()
    noisy = turned.with_noise(0.01)
    assert fq.residual_test(ARM, noisy)["passed"].mean() > 0.8


def test_responses_are_put_in_order():
    omega = np.linspace(1, 200, 90)
    frf = ARM.frequency_response(omega)
    frf = dataclasses.replace(frf, input_spectrum=np.ones((2, 90)))
    turned = dataclasses.replace(
        frf, response=frf.response[::-1, ::-1], input_names=("elbow", "shoulder"),
        output_names=("qe", "qs"),
    )  # fmt: skip
    assert near(fq.fit(ARM, turned, start={"a1": 15})) < 1e-8
    assert (fq.compare(ARM, turned).fit_percent > 99.99).all()


def test_the_other_way_round_is_refused():
    lag = fq.GreyBox(
        lambda a: ([[-a]], [[50.0]], [[1.0]], None), [fq.Parameter("a", 20.0)],
        inputs=["velocity"], outputs=["torque"],
    )  # fmt: skip
    record = fq.Record(RECORD.u[:, 0], RECORD.y[:, 0], 5e-3, input_names=["torque"],
                       output_names=["velocity"])  # fmt: skip
    with pytest.raises(ValueError, match="'torque' is an input of the data and an output of the"):
        fq.fit(lag, record)
    # a default name on one side alone says nothing
    plain = fq.GreyBox(lambda a, b: ([[-a]], [[b]], [[1.0]], None),
                       [fq.Parameter("a", 20.0), fq.Parameter("b", 50.0)])  # fmt: skip
    simple = fq.simulate(plain, fq.white_noise(500), 5e-3, input_names=["y"], output_names=["z"])
    assert fq.fit(plain, simple)["a"] == pytest.approx(20)


def test_names_of_which_only_one_side_knows_are_taken_by_place():
    plain = fq.Record(RECORD.u, RECORD.y, 5e-3)
    assert near(fq.fit(ARM, plain, start={"a1": 15})) < 1e-8
