"""What the report says of an estimate, by the weight of what speaks against it."""

import dataclasses

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.findings import Finding
from freqid.pages.explorer.scene import scene
from freqid.pages.explorer.state import State
from freqid.pages.explorer.words import believed, sentence
from freqid.pages.report.sentences import data, validated, verdict


def test_only_what_is_serious_is_held_against_an_estimate(plant, slow):
    est = fq.fit(plant, slow.with_noise(0.3, seed=1), band=(10, 80))
    minor = Finding("not physical", "d=-1 lies outside", severity="minor")
    serious = Finding("edge of a bound", "d=0 is at its bound: 0")
    assert verdict(dataclasses.replace(est, signs=[minor])).trusted
    found = verdict(dataclasses.replace(est, signs=[minor, serious, serious, "somebody's own"]))
    assert not found.trusted
    assert found.text.startswith("Edge of a bound: d=0 is at its bound: 0")


def test_the_record_that_was_fitted_validates_nothing(plant, slow):
    est = fq.fit(plant, slow, band=(10, 80))
    same = fq.Record(slow.u, slow.y, slow.dt, hold=slow.hold)
    with pytest.raises(ValueError, match="a record that was fitted"):
        validated(est, same)


def test_the_hold_of_each_input_and_many_experiments_are_told():
    plant = fq.mechanical(
        lambda m: m * np.eye(2), lambda k: k * np.array([[1.5, -1], [-1, 1]]),
        lambda c: c * np.eye(2), np.eye(2),
        parameters=[fq.Parameter("m", 1.0), fq.Parameter("k", 400.0), fq.Parameter("c", 4.0)],
    )  # fmt: skip
    u = np.random.default_rng(0).standard_normal((400, 2))
    held = {"u1": "zoh", "u2": "foh"}
    one = fq.simulate(plant, u, 0.01, hold=held, input_names=["u1", "u2"])
    runs = [one.with_noise(1e-5 * one.y.std(axis=0), seed=seed) for seed in range(52)]
    est = fq.fit(plant, runs[:2])
    told = dict(data(est))
    assert told["hold in the fit"] == "zoh, foh"
    told = dict(data(dataclasses.replace(est, data=runs)))
    assert told["and"] == "2 more"
    assert "experiment 50" in told
    assert "experiment 51" not in told


def test_the_explorer_says_why_there_is_no_fit():
    still = fq.Record(np.zeros(400), np.arange(400.0) % 3, 1e-3)
    shown = scene(State.of("low=10&high=80"), still)
    assert shown.estimate is None
    text, doubt = sentence(shown)
    assert doubt
    assert text.startswith("No fit: ")
    assert believed(shown) == (["No fit, no verdict."], False)


def test_a_black_box_beside_ones_own_record_has_no_truth(fast):
    state = State.of("hold=black box&factor=10&low=10&high=80")
    text, _ = sentence(scene(state, fast))
    assert text.startswith("Black box: ")
    assert "off by" not in text
    assert "off by" in sentence(scene(state))[0]
