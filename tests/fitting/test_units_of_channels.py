"""Parameters that are not in the unit printed beside them, for a channel is in another."""

import numpy as np
import pytest

import freqid as fq


def spring(torque="torque", angle="angle"):
    return fq.GreyBox(
        lambda J, b, k: ([[0, 1], [-k / J, -b / J]], [[0], [1 / J]], [[1, 0]], None),
        [
            fq.Parameter("J", 2e-3, "kg m²", lower=0),
            fq.Parameter("b", 0.01, "N m s/rad", lower=0),
            fq.Parameter("k", 5.0, "N m/rad", lower=0),
        ],
        inputs=[torque],
        outputs=[angle],
    )


def measured(units):
    u = np.random.default_rng(3).standard_normal(2000)
    y = fq.simulate(spring(), u, 2e-3).y
    names = {"input_names": ["torque"], "output_names": ["angle"]}
    record = fq.Record(u, y, 2e-3, units=units, **names)
    return record.with_noise(0.01 * float(y.std()))


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ({"angle": "°"}, "angle is in °"),
        ({"torque": "mNm", "angle": "rad"}, "torque is in mNm"),
        ({"torque": "mN·m"}, "torque is in mN·m"),
        ({"torque": "N m", "angle": "rad"}, None),
        ({"torque": "Nm", "angle": "ticks"}, "angle is in ticks"),
        ({"torque": "Nm", "angle": "widths"}, None),
        ({}, None),
    ],
)
def test_units_that_do_not_meet_are_a_doubt(units, said):
    """A spring of 5 N m/rad was trusted as one of 0.087: the angle was in degrees."""
    est = fq.fit(spring(), measured(units))
    assert est.verdict.trusted == (said is None)
    if said:
        assert est.warnings[0].kind == "units"
        assert said in est.warnings[0]


@pytest.mark.parametrize(
    ("gain", "doubted"), [("rad/(N m)", True), ("counts/(N m)", False), ("", False)]
)
def test_counts_are_doubted_where_a_parameter_means_another_unit(gain, doubted):
    def matrices(w, z, g):
        return [[0, 1], [-w * w, -2 * z * w]], [[0], [g * w * w]], [[1, 0]], None

    values = [("w", 50.0, "rad/s"), ("z", 0.05, ""), ("g", 0.2, gain)]
    plant = fq.GreyBox(matrices, [fq.Parameter(*v) for v in values])
    est = fq.fit(plant, measured({"torque": "N m", "angle": "counts"}), n_starts=1)
    assert any(w.kind == "units" for w in est.warnings) == doubted


def test_who_means_the_unit_of_his_file_says_so_in_his_parameters():
    def matrices(w, z, g):
        return [[0, 1], [-w * w, -2 * z * w]], [[0], [g * w * w]], [[1, 0]], None

    values = [("w", 50.0, "rad/s"), ("z", 0.05, ""), ("g", 0.2, "°/(N m)")]
    plant = fq.GreyBox(
        matrices, [fq.Parameter(*v) for v in values], inputs=["torque"], outputs=["angle"]
    )
    est = fq.fit(plant, measured({"torque": "N m", "angle": "°"}))
    assert not [w for w in est.warnings if w.kind == "units"]


def test_one_record_of_several_in_another_unit_is_refused():
    """The units of the last record had been those of all."""
    both = [measured({"angle": "°"}), measured({"angle": "rad"})]
    with pytest.raises(ValueError, match=r"data\[1\] has 'angle' in rad and the first in °"):
        fq.fit(spring(), both)
