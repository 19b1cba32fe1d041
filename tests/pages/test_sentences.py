"""What the report says of an estimate, by the weight of what speaks against it."""

import dataclasses

import pytest

import freqid as fq
from freqid.fitting.findings import Finding
from freqid.pages.report.sentences import validated, verdict


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
