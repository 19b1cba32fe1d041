"""Plants, ties, priors and user Jacobians."""

import control
import numpy as np
import pytest

import freqid as fq

BAND = (10, 80)


def test_a_drivetrain_of_two_is_the_papers_axis(plant):
    omega = np.geomspace(10, 600, 40)
    same = fq.drivetrain(2, J2=11.0).frequency_response(omega).response
    assert np.abs(same / plant.frequency_response(omega).response - 1).max() < 1e-12


def test_drivetrain_outputs_are_derivatives_of_each_other():
    omega = np.geomspace(5, 600, 40)
    for mass in ("motor", "arm"):
        names = [f"{mass} {what}" for what in ("position", "velocity", "acceleration")]
        G = fq.drivetrain(4, outputs=names).frequency_response(omega).response[:, 0]
        assert np.allclose(G[1], 1j * omega * G[0], rtol=1e-9)
        assert np.allclose(G[2], 1j * omega * G[1], rtol=1e-9)


def test_a_free_drivetrain_turns_as_one_body():
    model = fq.drivetrain(3, fm=0.0)
    inertia = model["J1"] + model["gear"] ** 2 * (model["J2"] + model["J3"])
    w = np.array([0.01])
    assert model.frequency_response(w).response[0, 0, 0] == pytest.approx(
        1 / (1j * w[0] * inertia), rel=1e-4
    )


def test_bad_drivetrains_are_named():
    with pytest.raises(ValueError, match="n_masses=1"):
        fq.drivetrain(1)
    with pytest.raises(ValueError, match="outputs='motor speed'"):
        fq.drivetrain(2, outputs=["motor speed"])
    with pytest.raises(ValueError, match="parameter='J9'"):
        fq.drivetrain(2, J9=1)


def test_ties_hold_during_the_fit(plant, fast):
    tied = plant.tie(Ja="11 / 9e-4 * Jm", d="sqrt(k) * 10 / sqrt(1.5e5)")
    est = fq.fit(tied, fast, band=BAND, start={"Jm": 1.1e-3, "k": 1.2e5})
    assert list(est.names) == ["Jm", "k", "fm"]
    assert list(est.parameters.index) == ["Jm", "k", "fm", "Ja", "d"]
    assert est["Ja"] == pytest.approx(11, rel=1e-8)
    assert est["d"] == pytest.approx(10, rel=1e-8)


def test_bad_ties_are_named(plant):
    for expression, words in (
        ({"Ja": "2 * Jx"}, "did you mean 'Jm'"),
        ({"Ja": "2 * ("}, "not an expression"),
        ({"Jx": "2"}, "parameter='Jx'"),
        ({"Ja": "k", "k": "Ja"}, "tied itself"),
        ({"Ja": "open('x')"}, "cannot be computed|parameter='open'"),
    ):
        with pytest.raises(ValueError, match=words):
            plant.tie(**expression)
    with pytest.raises(ValueError, match="is tied to"):
        plant.tie(Ja="2 * Jm").with_values(Ja=5)


def test_a_prior_is_weighed_against_the_data(rng):
    """A parameter of its own in a linear model: the textbook mean of two Gaussians.

    The noise is estimated anew at the compromise, where 2,000 residuals are 0.2 % larger.
    """
    gain = fq.GreyBox(lambda g: ([[-50.0]], [[50.0]], [[g]], None), [fq.Parameter("g", 2.0)])
    record = fq.simulate(gain, rng.standard_normal(2000), 0.05).with_noise(0.5, seed=2)
    alone = fq.fit(gain, record)
    value, std = alone["g"], alone.parameters.loc["g", "std"]
    mean, spread = value + 3 * std, std / 2
    both = fq.fit(gain.with_prior(g=(mean, spread)), record)
    weight = 1 / std**2 + 1 / spread**2
    assert both["g"] == pytest.approx((value / std**2 + mean / spread**2) / weight, rel=1e-4)
    assert both.parameters.loc["g", "std"] == pytest.approx(weight**-0.5, rel=3e-3)


def test_a_prior_settles_what_the_data_leave_open(rng):
    model = fq.GreyBox(
        lambda a, b: ([[-3.0]], [[a * b]], [[1.0]], None),
        [fq.Parameter("a", 1.0), fq.Parameter("b", 1.0, prior=(2.0, 0.1))],
    )
    truth = model.with_values(a=3.0, b=2.0)
    est = fq.fit(model, fq.simulate(truth, rng.standard_normal(400), 0.1).with_noise(0.01))
    assert est["b"] == pytest.approx(2, abs=0.01)
    assert est["a"] * est["b"] == pytest.approx(6, rel=0.01)
    assert est.warnings == []


def test_bad_priors_are_named(plant):
    with pytest.raises(ValueError, match="fixed and has a prior"):
        plant.with_prior(k=(1e5, 1e3)).fix("k")
    with pytest.raises(ValueError, match="must be \\(mean, std\\)"):
        plant.with_prior(k=3)
    with pytest.raises(ValueError, match="positive standard deviation"):
        plant.with_prior(k=(1e5, 0))


def test_a_users_jacobian_is_used(rng):
    calls = []

    def jacobian(m, c, k):
        calls.append(1)
        return {
            "m": ([[0, 0], [k / m**2, c / m**2]], [[0], [-1 / m**2]], [[0, 0]], None),
            "c": ([[0, 0], [0, -1 / m]], [[0], [0]], [[0, 0]], None),
            "k": ([[0, 0], [-1 / m, 0]], [[0], [0]], [[0, 0]], None),
        }

    def matrices(m, c, k):
        return [[0, 1], [-k / m, -c / m]], [[0], [1 / m]], [[1, 0]], None

    parameters = [fq.Parameter("m", 2.0), fq.Parameter("c", 0.3), fq.Parameter("k", 50.0)]
    model = fq.GreyBox(matrices, parameters, jacobian=jacobian)
    plain = fq.GreyBox(matrices, parameters)
    for names in (["m", "c", "k"], ["m", "k"]):
        ours = model.tie(c="0.15 * m") if len(names) == 2 else model
        theirs = plain.tie(c="0.15 * m") if len(names) == 2 else plain
        a, b = (x.linearise(x.values, names).derivative for x in (ours, theirs))
        for one, two in zip(a, b, strict=True):
            assert np.allclose(one, two, atol=1e-12)
    record = fq.simulate(model, rng.standard_normal(500), 0.05)
    est = fq.fit(model, record, start={"m": 2.5, "k": 40})
    assert est["m"] == pytest.approx(2, rel=1e-8)
    assert calls


def test_a_simulation_has_the_names_that_a_model_was_given():
    axis = fq.GreyBox(
        lambda J, d: ([[-d / J]], [[1 / J]], [[1.0]], None),
        [fq.Parameter("J", 0.5), fq.Parameter("d", 2.0)], inputs=["torque"], outputs=["speed"],
    )  # fmt: skip
    u = fq.white_noise(300, seed=1)
    record = fq.simulate(axis, u, 0.01)
    assert (record.input_names, record.output_names) == (("torque",), ("speed",))
    est = fq.fit(axis, record.with_noise(0.01, seed=2))
    for model in (est, est.model, est.to_control(), fq.fit(fq.OutputError(1), record)):
        assert fq.simulate(model, u, 0.01).output_names == ("speed",)
    said = fq.simulate(axis, u, 0.01, input_names=["m"], output_names=["v"])
    assert (said.input_names, said.output_names) == (("m",), ("v",))
    # ready-made plants, and labels that control makes up
    for model in (fq.two_mass(), fq.drivetrain(3), control.tf([1], [1, 1])):
        assert fq.simulate(model, u, 0.01).input_names == ("u",)


@pytest.mark.parametrize("hold", ["foh", "bl"])
def test_a_sampled_black_box_is_simulated_under_its_own_hold(hold):
    u = fq.white_noise(300)
    est = fq.fit(fq.OutputError(1), fq.simulate(fq.first_order(), u, 1e-3))
    with pytest.raises(ValueError, match="knows no other"):
        fq.simulate(est, u, 1e-3, hold=hold)
    own = fq.simulate(est, u, 1e-3, hold="zoh")
    np.testing.assert_array_equal(own.y, fq.simulate(est, u, 1e-3).y)


def test_a_plant_that_grows_beyond_numbers_is_named():
    plant = fq.first_order().with_values(a=-100.0)
    with pytest.raises(ValueError, match=r"unstable there; simulate less"):
        fq.simulate(plant, np.ones(20000), 1e-3)
    assert np.isfinite(fq.simulate(plant, np.ones(200), 1e-3).y).all()


@pytest.mark.parametrize("hold", [None, fq.ZeroOrderHold(0.01)])
def test_a_frequency_on_a_pole_is_named_without_warnings(hold):
    """All warnings are errors here."""
    integrator = fq.GreyBox(lambda k: ([[0]], [[k]], [[1]], None), [fq.Parameter("k", 2.0)])
    with pytest.raises(ValueError, match="omega=0 rad/s lies on a pole"):
        integrator.frequency_response([0.0, 1.0], hold)


def test_what_is_no_switch_and_no_unit_is_refused():
    with pytest.raises(ValueError, match="x: fixed='no' must be True or False"):
        fq.Parameter("x", 1.0, fixed="no")
    with pytest.raises(ValueError, match="x: unit=5 must be text"):
        fq.Parameter("x", 1.0, unit=5)


def test_a_negative_value_says_that_it_may_be_negative():
    """A coupling of -20 is no fault, and that of a value that was positive is one."""
    plant = fq.GreyBox(
        lambda a, c: ([[-a]], [[c]], [[1.0]], None),
        [fq.Parameter("a", 30.0), fq.Parameter("c", -20.0)],
    )
    assert plant.parameter("c").physical == (-np.inf, np.inf)
    record = fq.simulate(plant, fq.white_noise(400, seed=1), 1e-3).with_noise(1e-3, seed=2)
    assert "not physical" not in [w.kind for w in fq.fit(plant, record).warnings]
    turned = plant.with_values(c=20.0)
    assert turned.parameter("c").physical == (-np.inf, np.inf)
    asked = fq.GreyBox(plant.matrices, [fq.Parameter("a", 30.0), fq.Parameter("c", 20.0)])
    wrong = fq.fit(asked, record)
    assert "not physical" in [w.kind for w in wrong.warnings]
    # at the estimate it is as unphysical, whatever else is changed of it there
    for other in (wrong.model, wrong.model.fix("a"), wrong.model.with_bounds(c=(-100, 100))):
        assert other["c"] < 0
        assert other.parameter("c").physical == (0, np.inf)


def test_who_says_what_is_physical_is_believed():
    assert fq.Parameter("c", -20.0, physical=(0, np.inf)).physical == (0, np.inf)
    assert fq.Parameter("c", 20.0, physical=(-np.inf, 0)).physical == (-np.inf, 0)
