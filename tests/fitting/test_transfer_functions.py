"""Continuous black boxes, delays, order selection, and orders that polynomials cannot carry."""

import dataclasses

import numpy as np
import pytest

import freqid as fq

BAND = (10, 80)


def test_the_true_coefficients_come_back(plant, fast):
    for record in (fast, fast.decimate(10, keep_input=True)):
        est = fq.fit(fq.TransferFunction(2, 3), record, band=BAND)
        reference = plant.to_control()
        assert np.allclose(
            np.sort_complex(est.model.poles), np.sort_complex(reference.poles()), rtol=1e-7
        )
        assert est["b2"] == pytest.approx(1 / plant["Jm"], rel=1e-8)
        assert est["b0"] == pytest.approx(plant["k"] / (plant["Jm"] * plant["Ja"]), rel=1e-7)
        assert len(est.model.zeros()) == 2


def test_several_channels_share_their_poles(rng):
    model = fq.GreyBox(
        lambda k: (
            [[0, 1, 0, 0], [-k - 40, -0.5, 40, 0], [0, 0, 0, 1], [40, 0, -40, -0.5]],
            [[0, 0], [1, 0], [0, 0], [0, 1]],
            [[1, 0, 0, 0], [0, 0, 1, 0]],
            None,
        ),
        [fq.Parameter("k", 100.0)],
    )
    record = fq.simulate(model, rng.standard_normal((2500, 2)), 0.02)
    est = fq.fit(fq.TransferFunction(2, 4), record)
    omega = np.linspace(1, 30, 40)
    true = model.frequency_response(omega).response
    assert (
        np.abs(est.model.frequency_response(omega).response - true).max()
        < 1e-6 * np.abs(true).max()
    )
    assert est.to_control().ninputs == 2


def delayed_record(plant, tau, dt, n=50):
    """Output of the held input that comes tau late, simulated n times finer."""
    u = fq.chirp(10, 80, 8, dt)
    shift = round(tau / dt * n)
    fine = np.concatenate([np.zeros(shift), np.repeat(u, n)])[: len(u) * n]
    return fq.Record(u, fq.simulate(plant, fine, dt / n).y[::n], dt)


@pytest.mark.study
@pytest.mark.parametrize("steps", [0, 0.36, 4.52])
def test_delays_of_parts_of_a_sample(plant, steps):
    dt = 2e-3
    record = delayed_record(plant, steps * dt, dt)
    est = fq.fit(fq.TransferFunction(2, 3, delay="estimate"), record, band=BAND)
    # what is late at the start of the record came from before it, and is not in the model
    assert est["delay"] == pytest.approx(steps * dt, abs=2e-3 * dt)
    assert est["a1"] == pytest.approx(25607.1, rel=1e-4)
    known = fq.fit(fq.TransferFunction(2, 3, delay=steps * dt), record, band=BAND)
    assert known["a1"] == pytest.approx(25607.1, rel=1e-4)


def test_the_response_of_a_delay(plant, fast):
    est = fq.fit(fq.TransferFunction(2, 3), fast, band=BAND)
    late = dataclasses.replace(est.model, delay=3.4e-3)
    omega, hold = np.array([100.0, 200.0]), fq.ZeroOrderHold(1e-3)
    plain = est.model.frequency_response(omega).response
    turned = late.frequency_response(omega).response
    assert np.allclose(turned, plain * np.exp(-1j * omega * 3.4e-3))
    whole = dataclasses.replace(est.model, delay=3e-3).frequency_response(omega, hold).response
    expected = est.model.frequency_response(omega, hold).response * np.exp(-1j * omega * 3e-3)
    assert np.allclose(whole, expected, rtol=1e-10)
    with pytest.raises(ValueError, match="control systems have no delay"):
        late.to_control()
    # 6.8 samples: five parts in a sample, and 34 of these
    fine = np.repeat(fast.u[:4000], 5)
    moved = np.concatenate([np.zeros(34), fine])[: len(fine)]
    expected = fq.simulate(est.model, moved, fast.dt / 5).y[::5]
    assert np.allclose(fq.simulate(late, fast.u[:4000], fast.dt).y, expected, atol=1e-9)


def test_order_twelve_with_four_lightly_damped_modes():
    modes, damping = np.array([20.0, 45, 80, 130]), 0.01
    A = np.zeros((12, 12))
    for i, (w, z) in enumerate([*((w, damping) for w in modes), (10.0, 0.6), (60.0, 0.6)]):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-w * w, -2 * z * w]]
    B = np.tile([[0.0], [1.0]], (6, 1))
    C = np.array([[20, 0, 45, 0, 80, 0, 130, 0, 30, 0, 100, 0]], dtype=float)
    plant = fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])
    record = fq.simulate(plant, np.random.default_rng(0).standard_normal(10000), 0.01)
    est = fq.fit(fq.OutputError(12), record.with_noise(0.01 * record.y.std()))
    poles = est.to_continuous().poles()
    for w in modes:
        near = poles[np.argmin(np.abs(poles - w * (-damping + 1j)))]
        assert abs(near) == pytest.approx(w, rel=1e-3)
        assert -near.real / abs(near) == pytest.approx(damping, rel=0.1)


def test_select_order_finds_three(slow):
    table = fq.select_order(
        slow.with_noise(0.3), range(1, 6), hold="foh", band=BAND, feedthrough=True
    )
    assert table["order"].tolist() == [1, 2, 3, 4, 5]
    assert table.attrs["best"] >= 3
    remembered = fq.select_order(slow.with_noise(0.3), [2, 3, 4], band=BAND)
    assert remembered.attrs["best"] == 3
    assert (remembered["cost"].diff().dropna() < 0).all()
    assert remembered["cross_validation"].iloc[0] > 10 * remembered["cross_validation"].iloc[1]
    ax = fq.plot_orders(remembered)
    assert ax.get_xlabel() == "order"
    with pytest.raises(ValueError, match="orders is empty"):
        fq.select_order(slow, [])
    with pytest.raises(ValueError, match="orders=0"):
        fq.select_order(slow, [0])


def test_bad_transfer_functions_are_named(slow):
    for arguments, words in (
        ({"zeros": 3, "poles": 2}, "more than poles"),
        ({"zeros": -1, "poles": 2}, "zeros=-1"),
        ({"zeros": 1, "poles": 2, "delay": -1}, "must not be negative"),
    ):
        with pytest.raises(ValueError, match=words):
            fq.TransferFunction(**arguments)
    with pytest.raises(ValueError, match="needs a zero-order hold"):
        fq.fit(fq.TransferFunction(2, 3, delay=1e-3), slow, hold="foh")
    with pytest.raises(ValueError, match="domain='frequency'"):
        fq.fit(fq.TransferFunction(2, 3, delay=1e-3), slow, domain="time")


def test_more_starts_are_tried_and_never_cost_more(fast):
    """``n_starts`` was ignored."""
    record = fast.decimate(10, keep_input=True).with_noise(0.05)
    spec = fq.TransferFunction(2, 3)
    one = fq.fit(spec, record, band=(10, 80))
    more = fq.fit(spec, record, band=(10, 80), n_starts=9, seed=3)
    assert more.n_starts == 9
    assert one.n_starts < 9
    assert more.cost <= one.cost * (1 + 1e-9)
    again = fq.fit(spec, record, band=(10, 80), n_starts=9, seed=3)
    assert again.cost == more.cost
    assert more.n_agreed > 1
