"""Coulomb friction as a known input: the mean of its sign over a sample, not the sampled sign."""

import numpy as np
import pytest

import freqid as fq

J, D, FRICTION = 0.5, 2.0, 1.5
DT, N = 2e-3, 5000


def velocities(torque):
    """J dv/dt = torque − D v − FRICTION sign(v), from zero crossing to zero crossing, exactly."""
    v, seen = 0.0, []
    for u in torque:
        seen.append(v)
        left = DT
        while left > 0:
            sign = np.sign(v) or np.sign(u)
            if v == 0 and abs(u) <= FRICTION:
                break
            final = (u - FRICTION * sign) / D
            later = final + (v - final) * np.exp(-D / J * left)
            if v == 0 or later * v >= 0:
                v = later
                break
            left -= J / D * np.log((v - final) / -final)
            v = 0.0
    return np.array(seen)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(3))
def test_the_mean_of_the_sign_over_a_sample_tells_the_friction(seed):
    u = 8 * fq.chirp(0.3, 40, duration=N * DT, dt=DT)
    u = u + 0.5 * np.random.default_rng(seed).standard_normal(N)
    record = fq.Record(u, velocities(u), DT, input_names=["torque"], output_names=["velocity"])
    plant = fq.GreyBox(
        lambda J, d, Fc: ([[-d / J]], [[1 / J, Fc / J]], [[1.0]], [[0.0, 0.0]]),
        [fq.Parameter("J", 0.4), fq.Parameter("d", 1.5), fq.Parameter("Fc", 1.0)],
        inputs=["torque", "coulomb"], outputs=["velocity"],
    )  # fmt: skip
    before, after = record["velocity"], np.append(record["velocity"][1:], record["velocity"][-1])
    turns = before * after < 0
    friction = -np.sign(before + after)
    friction[turns] = -(abs(after) - abs(before))[turns] / (after - before)[turns]
    off = {}
    for name, column, hold in (("mean", friction, "zoh"), ("sampled", -np.sign(before), "bl")):
        est = fq.fit(plant, record.with_input("coulomb", column, hold=hold))
        off[name] = np.array([est["J"] / J, est["d"] / D, est["Fc"] / FRICTION]) - 1
    assert turns.sum() > 300
    assert np.abs(off["mean"]).max() < 0.005, off
    # the damping and the friction
    assert np.abs(off["sampled"][1:]).min() > 0.02, off
