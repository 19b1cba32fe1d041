"""Friction of a mass that no damper of the model holds, by a grey box that sees the motor alone."""

import re

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.suspects.elements import elements
from freqid.fitting.suspects.masses import masses
from tests.fitting.test_bent_black_boxes import LOAD, MOTOR, C, D, K, measured


def matrices(J1, J2, k, c, d):
    A = [
        [0, 0, 1, 0], [0, 0, 0, 1],
        [-k / J1, k / J1, -(c + d) / J1, c / J1], [k / J2, -k / J2, c / J2, -c / J2],
    ]  # fmt: skip
    return A, [[0], [0], [1 / J1], [0]], [[0, 0, 1, 0]], None


def axis(factor=1.0):
    values = {"J1": MOTOR, "J2": LOAD, "k": K, "c": C, "d": D}
    return fq.GreyBox(matrices, [fq.Parameter(n, factor * v, lower=0) for n, v in values.items()])


def test_springs_are_no_dampers_by_rounding():
    """The force of a spring is at right angles to its motion, up to a sign of 1e-18."""
    for seed in range(40):
        factors = np.exp(0.4 * np.random.default_rng(seed).standard_normal(5))
        plant = axis()
        plant = plant.with_values(
            **{p.name: float(p.value * f) for p, f in zip(plant.parameters, factors, strict=True)}
        )
        assert {e.name: e.damps for e in elements(plant)} == {"k": False, "c": True, "d": True}
        (load,) = masses(plant)
        assert load.rubs == "at the far end of k turns round with the speed there"
        # of a newton metre there
        assert load.force[3] == pytest.approx(-1 / plant["J2"])


def test_an_acceleration_shows_friction_at_once():
    """An output whose row of C is that of A has the force in it before it has moved anything."""

    def seen(J1, J2, k, c, d):
        A, B, C, _ = matrices(J1, J2, k, c, d)
        return A, B, [C[0], A[3], [2 * a for a in A[2]]], None

    plant = fq.GreyBox(seen, axis().parameters)
    (load,) = masses(plant)
    A, _, C, _ = plant.state_space()
    # Newton's law: of a newton metre against the motion
    np.testing.assert_allclose(load._at_once(A, C, load.force), [0, -1 / LOAD, 0], atol=1e-12)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["white", "binary", "multisine"])
@pytest.mark.parametrize("load", [0.02, 0.06])
def test_friction_of_a_load_is_named_with_its_place(kind, load):
    """It was "another mode", or a friction of the motor. The dampers take a part of it."""
    for record in measured(kind, load=load):
        est = fq.fit(axis(0.8), record)
        said = est.warnings[0]
        assert said.kind == "friction"
        assert "at the far end of k" in said
        size = float(re.search(r"a friction of ([\d.]+)", said)[1])
        assert 0.1 < size / (20 * load) < 1.1
        assert not est.verdict.trusted


@pytest.mark.study
def test_an_axis_without_friction_is_not_accused():
    for kind in ("white", "binary", "multisine"):
        for record in measured(kind):
            est = fq.fit(axis(0.8), record)
            assert est.verdict.trusted
            assert not {"friction", "nonlinear"} & {w.kind for w in est.warnings}
