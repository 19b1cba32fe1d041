"""Black boxes: the paper's output error, exact recovery, and the way back to continuous time."""

import control
import numpy as np
import pytest

import freqid as fq
from freqid.fitting.black_box.order_minimum import within_circle
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.reading import Reading
from freqid.lti import Plane, StateSpace
from freqid.paper import notch, numerator

BAND = (10, 80)


def test_the_papers_output_error(slow):
    est = fq.fit(fq.OutputError(3), slow, hold="zoh", domain="time", initial_state="zero")
    b = numerator(est)
    assert np.allclose(b, [1.052e3, -6.80e3, 1.278e7], rtol=0.01)
    assert (np.abs(est.model.zeros) > 1).all()
    assert notch(b) == pytest.approx(17.5, abs=0.05)


@pytest.mark.parametrize("factor", [None, 10])
def test_the_true_plant_comes_back(plant, fast, factor):
    record = fast if factor is None else fast.decimate(factor, keep_input=True)
    est = fq.fit(fq.OutputError(3), record, band=BAND)
    found = np.sort_complex(est.to_continuous().poles())
    true = np.sort_complex(plant.to_control().poles())
    assert np.abs(found / true - 1).max() < 1e-7


def test_the_remembered_hold_cures_the_black_box_too(plant, slow):
    est = fq.fit(fq.OutputError(3), slow, band=BAND)
    assert est.model.dt == 0.5e-3
    assert np.allclose(numerator(est), [1111.11, 1010.1, 1.51515e7], rtol=5e-3)


def test_inverting_each_hold(plant, rng):
    A = rng.standard_normal((4, 4)) - 3 * np.eye(4)
    system = control.ss(A, rng.standard_normal((4, 2)), rng.standard_normal((2, 4)), 0)
    model = fq.GreyBox(lambda g: (A, g * system.B, system.C, None), [fq.Parameter("g", 1.0)])
    for hold in ("zoh", "foh"):
        record = fq.simulate(model, rng.standard_normal((1500, 2)), 0.1, hold=hold)
        est = fq.fit(fq.OutputError(4, feedthrough=hold == "foh"), record)
        back = est.to_continuous()
        omega = np.linspace(0.1, 20, 50)
        G, H = system(1j * omega), back(1j * omega)
        assert np.abs(G - H).max() < 1e-6 * np.abs(G).max()


def test_no_real_preimage_is_an_error(rng):
    system = control.ss([[-0.5]], [[1.0]], [[1.0]], 0, 0.1)
    record = fq.simulate(system, rng.standard_normal(300), 0.1)
    est = fq.fit(fq.OutputError(1), record)
    assert est.model.poles[0].real == pytest.approx(-0.5)
    with pytest.raises(ValueError, match="negative real axis"):
        est.to_continuous()
    with pytest.raises(ValueError, match="own period"):
        est.to_continuous(fq.ZeroOrderHold(0.2))


def test_standard_errors_of_coefficients_match_the_scatter(rng):
    system = control.ss([[0.8, 0.4], [-0.4, 0.8]], [[1.0], [0.3]], [[1.0, 0.0]], 0, 1.0)
    record = fq.simulate(system, rng.standard_normal(600), 1.0)
    fits = [fq.fit(fq.OutputError(2), record.with_noise(0.2, seed=s)) for s in range(60)]
    scatter = np.std([e.values for e in fits], axis=0)
    claimed = np.mean([e.parameters["std"] for e in fits], axis=0)
    assert fits[0].parameters.index.tolist() == ["b1", "b2", "a1", "a2"]
    assert np.allclose(scatter / claimed, 1, atol=0.35)


def test_subspace_start_finds_the_poles_by_itself(plant, fast):
    from freqid.fitting.black_box.subspace import identify, plane_for
    from freqid.fitting.cost.charts import from_plane
    from freqid.fitting.reading import Reading
    from freqid.lti.responses import Plane

    reading = Reading.of(fast, band=BAND)
    plane = plane_for(reading.lines(Plane()).points.z)
    start = from_plane(identify([reading.lines(plane)], 3, False), plane)
    period = reading.hold.period
    found = np.sort_complex(np.log(np.linalg.eigvals(start.A).astype(complex)) / period)
    true = np.sort_complex(np.linalg.eigvals(plant.state_space().A))
    assert np.abs(found / true - 1).max() < 1e-5


def test_data_of_several_holds_have_no_one_sampled_model(plant, fast):
    other = fq.simulate(plant, fq.chirp(10, 80, 4, 1e-3), 1e-3, hold="foh")
    with pytest.raises(ValueError, match="several ways"):
        fq.fit(fq.OutputError(3), [fast, other], band=BAND)
    est = fq.fit(fq.TransferFunction(2, 3), [fast, other], band=BAND)
    assert np.allclose(np.sort_complex(est.model.poles), np.sort_complex(plant.poles), rtol=1e-4)


def test_bad_black_boxes_are_named(slow):
    with pytest.raises(ValueError, match="order=0"):
        fq.OutputError(0)
    with pytest.raises(ValueError, match="start has no meaning"):
        fq.fit(fq.OutputError(2), slow, start={"a": 1})
    with pytest.raises(ValueError, match="widen the band"):
        fq.fit(fq.OutputError(9), slow, band=(20, 20.4))


def test_the_refined_start_lands_near_the_minimum_in_noise(rng):
    """Subspace poles alone are twice the least cost here; a light mode under 10 % noise."""
    from freqid.fitting.black_box.refinement import first_model
    from freqid.fitting.black_box.subspace import identify, plane_for
    from freqid.fitting.cost.charts import Chart
    from freqid.fitting.cost.objective import Objective
    from freqid.fitting.reading import Reading

    w = 2 * np.pi * np.array([10, 10.6])
    A = np.zeros((4, 4))
    for i, wi in enumerate(w):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, wi], [-wi, -0.01 * wi]]
    system = control.ss(A, [[0], [w[0]], [0], [w[1]]], [[1, 0, 1, 0]], 0)
    record = fq.simulate(system, rng.standard_normal(4000), 0.01)
    record = record.with_noise(0.1 * record.y.std(), seed=2)
    plane = plane_for(np.exp(1j * np.linspace(0.01, np.pi, 100)))
    experiment = Reading.of(record).lines(plane)

    def cost(model):
        chart = Chart(model, False, plane, 0.01)
        return Objective(chart, [experiment]).point(np.zeros(chart.size)).cost

    least = fq.fit(fq.OutputError(4), record).cost
    assert cost(first_model([experiment], 4, False)) < 1.001 * least
    assert cost(identify([experiment], 4, False)) > 1.1 * least


@pytest.mark.study
@pytest.mark.parametrize("spec", [fq.OutputError(2), fq.TransferFunction(1, 2)])
def test_error_bars_of_black_boxes_hold_in_coloured_noise(spec):
    """Noise with a resonance beside the plant's: bars of white noise hold in two cases of three."""
    from scipy.signal import lfilter

    runs, dt = 60, 0.01
    a = np.poly([0.7 + 0.5j, 0.7 - 0.5j])
    colour = np.poly([0.7 + 0.55j, 0.7 - 0.55j])
    rng = np.random.default_rng(7)
    inside, values = 0.0, []
    truth = np.array([0.5, -0.2, *a[1:]])
    if isinstance(spec, fq.TransferFunction):
        clean = rng.standard_normal(4000)
        exact = fq.fit(spec, fq.Record(clean, lfilter([0, 0.5, -0.2], a, clean), dt=dt))
        truth = exact.values
    for _ in range(runs):
        u, noise = rng.standard_normal(2000), lfilter([1], colour, rng.standard_normal(2000))
        est = fq.fit(spec, fq.Record(u, lfilter([0, 0.5, -0.2], a, u) + 0.1 * noise, dt=dt))
        inside += (np.abs(est.values - truth) < 1.96 * est.parameters["std"].to_numpy()) / runs
        values.append(est.values)
    # four standard deviations of the share that holds below 95 %
    assert (inside > 0.95 - 4 * np.sqrt(0.95 * 0.05 / runs)).all()
    assert np.allclose(np.std(values, axis=0), est.parameters["std"], rtol=0.35)


def test_error_bars_of_black_boxes_in_white_noise_are_those_of_white_noise(rng):
    """Against σ²(JᵀJ)⁻¹ with the Jacobian of the time domain, by differences."""
    from scipy.signal import lfilter

    a = np.poly([0.7 + 0.5j, 0.7 - 0.5j])
    u = rng.standard_normal(20000)
    theta = np.array([0.5, -0.2, *a[1:]])

    def output(t):
        return lfilter([0, *t[:2]], [1, *t[2:]], u)

    J = np.array([(output(theta + s) - output(theta)) / 1e-6 for s in 1e-6 * np.eye(4)]).T
    expected = 0.1 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    record = fq.Record(u, output(theta), dt=0.01).with_noise(0.1, seed=3)
    est = fq.fit(fq.OutputError(2), record)
    assert np.allclose(est.parameters["std"], expected, rtol=0.1)


def test_a_stable_start_lies_inside_of_the_unit_circle():
    """Rounding put a pole of a start on it, and fit said that the model cannot be computed."""
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    record = fq.simulate(fq.first_order(), fq.white_noise(300, seed=1), 1e-3).with_noise(
        0.1, seed=1
    )
    on_it = StateSpace(turn * (1 + 1e-13), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
    inside = within_circle(on_it)
    assert np.abs(np.linalg.eigvals(inside.A)).max() < 1
    assert np.allclose(inside.A, on_it.A, atol=1e-8)
    chart = Chart(inside, False, Plane(), 1e-3, stable=True)
    lines = Reading.of(record).lines(Plane())
    assert np.isfinite(Objective(chart, [lines]).point(np.zeros(chart.size)).cost)


def test_an_output_that_stands_still_is_told_by_its_name():
    """Found: "the model cannot be computed at poles ..., give another start"."""
    u = fq.white_noise(300, seed=1)
    record = fq.Record(u, np.column_stack([u, np.ones(300)]), 1.0, output_names=("a", "b"))
    with pytest.raises(ValueError, match="'b' is constant"):
        fq.fit(fq.OutputError(2), record)


def test_a_delay_that_is_none_is_no_reason_for_doubt_without_noise():
    """Found: "not settled", of a cost that is rounding."""
    plant = fq.GreyBox(
        lambda w, z, g: ([[0, w], [-w, -2 * z * w]], [[0], [w * g]], [[1.0, 0]], None),
        [fq.Parameter("w", 0.2 * np.pi), fq.Parameter("z", 0.02), fq.Parameter("g", 1.0)],
    )
    record = fq.simulate(plant, fq.white_noise(300, seed=1), 1.0)
    assert fq.fit(fq.TransferFunction(0, 2, delay="estimate"), record).verdict.trusted


def test_a_pole_on_a_line_is_no_start_and_says_nothing_by_itself(capfd):
    """An integrator at the line of zero divided by nothing, and LAPACK wrote to the terminal."""
    from freqid.fitting.black_box.held_inputs import inputs_of
    from freqid.fitting.reading import Reading
    from freqid.lti import Plane

    record = fq.simulate(fq.first_order(), fq.white_noise(200, seed=1), 1e-3)
    lines = [Reading.of(record).lines(Plane())]
    with pytest.raises(np.linalg.LinAlgError, match="on a line"):
        inputs_of(lines, np.eye(1), np.ones((1, 1)), False)
    assert capfd.readouterr() == ("", "")
