"""Verdicts on measured data: what halves confirm is trusted, what they do not is doubted."""

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io

import freqid as fq

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
import ruler_robot


def daisy(measured, name):
    x = np.loadtxt(measured / "daisy" / f"{name}.dat")
    return fq.Record(x[:, 0], x[:, 1], 1.0)


def kinds(est):
    return {w.kind for w in est.warnings if w.severity == "serious"}


def test_the_robot_arm_with_its_feedthrough_and_without(measured):
    record = daisy(measured, "robot_arm")
    whole, lacking = (
        fq.fit(fq.OutputError(4, feedthrough=direct), record) for direct in (True, False)
    )
    assert whole.verdict.grade == "trust"
    assert sorted(whole.modes()["damping"].round(4)) == pytest.approx([0.0047, 0.0061], abs=2e-3)
    assert lacking.verdict.grade == "doubt"
    assert lacking.warnings[0].kind == "feedthrough"


@pytest.mark.study
@pytest.mark.parametrize("order", [3, 4, 6, 8])
def test_flutter_is_not_trusted(measured, order):
    """One order explained 77 % and was trusted; its mode moves by 32 % between halves."""
    est = fq.fit(fq.OutputError(order), daisy(measured, "flutter"))
    assert est.verdict.grade != "trust"
    assert kinds(est) & {"unsteady", "unstable", "feedback"}


@pytest.mark.study
def test_the_ruler_robot_is_trusted_for_the_mode_that_repeats_confirm(measured):
    """Halves of a sweep see other modes each, halves of the repeats the same ones."""
    records = [r.detrend() for r in ruler_robot.read_all(measured / "ruler_robot")]
    est = fq.fit(fq.OutputError(6), records, band=ruler_robot.BAND)
    assert est.verdict.grade == "trust"
    modes = est.modes()
    assert modes["frequency"].iloc[(modes["frequency"] - 17).abs().argmin()] == pytest.approx(
        17.1, abs=0.2
    )


@pytest.mark.study
def test_the_f16_is_trusted_for_its_wing_torsion(measured):
    data = scipy.io.loadmat(measured / "f16" / "F16Data_FullMSine_Level1.mat", squeeze_me=True)
    record = fq.Record(data["Force"], data["Acceleration"][2], 1 / 400, hold="bl")
    spec = fq.OutputError(10, feedthrough=True, stable=True)
    est = fq.fit(spec, record, band=(3, 10))
    assert est.verdict.grade == "trust"
    frequency = est.modes()["frequency"]
    assert frequency.iloc[(frequency - 7.3206).abs().argmin()] == pytest.approx(7.3206, abs=0.01)
