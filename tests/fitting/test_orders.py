"""Black boxes of rising order, stable ones, and which order it takes."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq


@pytest.fixture(scope="module")
def arm(measured_daisy):
    """The flexible robot arm of DaISy, 1,024 samples."""
    x = np.loadtxt(measured_daisy / "robot_arm.dat")
    return fq.Record(x[:, 0], x[:, 1], 1.0)


@pytest.fixture(scope="module")
def measured_daisy(request):
    folder = request.getfixturevalue("measured") / "daisy"
    if not folder.is_dir():
        pytest.skip(f"no measured data: {folder} is missing")
    return folder


def noisy_modes(n=600, noise=0.02, seed=0):
    """Two light modes under white input."""
    model = fq.GreyBox(
        lambda w, v: (
            [[0, 1, 0, 0], [-w * w, -0.02 * w, 0, 0], [0, 0, 0, 1], [0, 0, -v * v, -0.04 * v]],
            [[0], [w * w * 0.02], [0], [v * v * 0.04]],
            [[1, 0, 1, 0]],
            None,
        ),
        [fq.Parameter("w", 0.3), fq.Parameter("v", 1.4)],
    )
    record = fq.simulate(model, np.random.default_rng(seed).standard_normal(n), 1.0)
    return record.with_noise(noise * record.y.std(), seed=1000 + seed)


@pytest.mark.study
@pytest.mark.parametrize("stable", [False, True])
def test_the_cost_never_rises_with_the_order(arm, stable):
    for record in (arm, noisy_modes()):
        costs = []
        for order in range(1, 8):
            est = fq.fit(fq.OutputError(order, stable=stable), record)
            costs.append(est.cost)
            if stable:
                assert np.abs(est.model.poles).max() < 1
        assert (np.diff(costs) <= 1e-6 * np.array(costs[:-1])).all()


def test_nor_for_an_output_that_was_decimated(plant):
    clean = fq.simulate(plant, fq.chirp(10, 80, 3, 0.5e-3), 0.5e-3)
    record = clean.with_noise(1.0, seed=0).decimate(2)
    costs = [fq.fit(fq.OutputError(n), record).cost for n in (2, 3, 4, 5)]
    assert (np.diff(costs) <= 1e-6 * np.array(costs[:-1])).all()


@pytest.mark.study
@pytest.mark.parametrize("seed", [100, 101])
@pytest.mark.parametrize("stable", [False, True])
def test_nor_with_several_channels(seed, stable):
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.standard_normal((150, 2)), axis=0)
    y = np.cumsum(rng.standard_normal((150, 2)), axis=0) + 0.5 * u[:, :1]
    record = fq.Record(u, y, 1.0)
    fits = [fq.fit(fq.OutputError(n, stable=stable), record) for n in range(1, 5)]
    costs = np.array([est.cost for est in fits])
    assert (np.diff(costs) <= 1e-6 * costs[:-1]).all()
    more = fq.fit(fq.OutputError(2, stable=stable), record, n_starts=4)
    assert more.n_starts == 4
    assert more.cost <= costs[1] * (1 + 1e-9)


@pytest.mark.study
def test_an_unstable_model_says_so(arm):
    est = fq.fit(fq.OutputError(5), arm)
    unstable = [w for w in est.warnings if w.kind == "unstable"]
    assert bool(unstable) == bool(np.abs(est.model.poles).max() > 1)


def test_more_starts_are_tried():
    record = noisy_modes()
    one, many = (fq.fit(fq.OutputError(3), record, n_starts=n) for n in (1, 8))
    assert many.n_starts == 8
    assert many.cost <= one.cost * (1 + 1e-9)


@pytest.mark.parametrize("scale", [1e-120, 1e-30, 1e15, 1e30, 1e120])
def test_units_change_nothing(scale):
    record = noisy_modes()
    expected = fq.fit(fq.OutputError(4), record).fit_percent
    for u, y in ((record.u * scale, record.y), (record.u, record.y * scale)):
        found = fq.fit(fq.OutputError(4), fq.Record(u, y, 1.0)).fit_percent
        assert found == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("spec", [fq.OutputError(2), fq.TransferFunction(1, 2)])
def test_inputs_that_are_the_same_are_refused(spec):
    record = noisy_modes()
    twice = fq.Record(np.column_stack([record.u, 2 * record.u]), record.y, 1.0)
    with pytest.raises(ValueError, match="inputs 1, 2 depend"):
        fq.fit(spec, twice)


def test_orders_beyond_the_data_are_refused():
    with pytest.raises(ValueError, match="order=200 has 600 unknowns"):
        fq.fit(fq.OutputError(200), noisy_modes(1000))


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_the_right_order_is_chosen(seed):
    table = fq.select_order(noisy_modes(1500, 0.01, seed), range(2, 7))
    assert table.attrs["best"] == 4
    assert table["cross_validation"].idxmin() == 2


@pytest.mark.parametrize("periods", [1, 4, 8])
def test_lines_between_those_of_a_periodic_input_hold_nothing_out(periods):
    """Of four periods each fourth line is driven, and was held out together with all others."""
    u = fq.multisine((1, 80), 2.0, 2e-3, periods=periods)
    record = fq.simulate(fq.two_mass(), u, 2e-3)
    record = record.with_noise(0.05)
    table = fq.select_order(record, range(2, 5), criterion="cross_validation")
    least = table["cross_validation"].to_numpy()
    assert table.attrs["best"] >= 3
    # the noise's own variance, a little more of it for what was learnt
    np.testing.assert_allclose(least[1:], 0.05**2, rtol=0.2)


@pytest.mark.study
def test_feedthrough_and_dead_time_are_chosen_in_any_unit():
    u = np.random.default_rng(3).standard_normal(800)
    lag = fq.simulate(fq.first_order(b=20, a=20), u, 5e-3)
    y = np.concatenate([np.zeros(2), lag.y[:-2]])
    y = y + 0.02 * np.random.default_rng(4).standard_normal(800)
    for scale in (1e-6, 1.0, 1e6):
        record = fq.Record(u, scale * y, 5e-3)
        found = fq.select_order(record, [1, 2], feedthrough=None, delays=range(5)).attrs
        # behind one sample more an order with feedthrough is the same model
        assert found["best"] == 1
        assert found["delay"] - found["feedthrough"] == 2


def test_an_order_that_fails_keeps_the_table():
    table = fq.select_order(noisy_modes(60), [2, 40])
    assert "data hold 60 real values" in table["error"].iloc[1]
    assert table.attrs["best"] == 2
    for wrong in ({"delays": []}, {"feedthrough": "both"}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            fq.select_order(noisy_modes(60), [2], **wrong)


@pytest.mark.study
def test_a_fast_input_beside_a_slow_output(plant):
    clean = fq.simulate(plant, fq.chirp(10, 80, 10, 0.5e-3), 0.5e-3)
    record = clean.with_noise(0.05, seed=1).decimate(40, keep_input=True)
    sampled, rational = fq.OutputError(3), fq.TransferFunction(2, 3)
    assert fq.fit(sampled, record).cost < 1.001 * fq.fit(rational, record).cost


def test_a_mode_above_nyquist_is_named():
    mode = fq.GreyBox(
        lambda w, z: ([[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[1, 0]], None),
        [fq.Parameter("w", 2 * np.pi * 45.186), fq.Parameter("z", 0.01)],
    )
    record = fq.simulate(mode, fq.white_noise(400), 1 / 40)
    est = fq.fit(mode, record, start={"w": 2 * np.pi * 45.1})
    assert est["w"] / (2 * np.pi) == pytest.approx(45.186, rel=1e-6)
    assert any(w.kind == "above Nyquist" for w in est.warnings)


def test_a_free_double_integrator_is_recognised():
    def coupled(J1, J2, k, c):
        A = [[0, 1, 0, 0], [-k / J1, -c / J1, k / J1, c / J1],
             [0, 0, 0, 1], [k / J2, c / J2, -k / J2, -c / J2]]  # fmt: skip
        return A, [[0], [1 / J1], [0], [0]], [[1.0, 0, 0, 0]], None

    values = {"J1": 1e-4, "J2": 3e-3, "k": 50.0, "c": 1e-3}
    model = fq.GreyBox(coupled, [fq.Parameter(n, v) for n, v in values.items()])
    record = fq.simulate(model, fq.white_noise(500), 1e-4)
    assert fq.compare(model, record).fit_percent[0] > 99.99
    est = fq.fit(model, record, start={"k": 40.0, "J1": 1.2e-4})
    assert est["k"] == pytest.approx(50, rel=1e-6)
    assert est.fit_percent > 99.99


@pytest.mark.study
def test_an_integrator_that_may_grow_is_no_reason_for_doubt():
    """A pole at one, within its error bar of the unit circle, and one that is truly beyond it."""

    def severities(rate):
        said = []
        for seed in range(8):
            u = fq.white_noise(600, seed=seed)
            y = scipy.signal.lfilter([0, 0.1], [1, -np.exp(rate * 0.01)], u)
            y = y + 0.2 * y.std() * np.random.default_rng(seed).standard_normal(600)
            est = fq.fit(fq.OutputError(1), fq.Record(u, y, 0.01))
            said += [w.severity for w in est.warnings if w.kind == "unstable"]
        return said

    assert set(severities(0.0)) <= {"minor"}
    assert "minor" in severities(0.0)
    assert severities(0.5) == ["serious"] * 8


@pytest.mark.study
def test_a_fit_that_may_grow_explains_no_less_than_one_that_may_not():
    """In coloured noise a free fit had a cost 0.5 % above that of a stable one, its own kin."""
    rng = np.random.default_rng([16, 13])
    poles = np.exp(np.array([-2 + 40j, -2 - 40j, -30]) * 0.02)
    u = np.repeat(rng.standard_normal(61), 10)[:600]
    y = scipy.signal.lfilter(np.r_[0, rng.standard_normal(3)], np.poly(poles).real, u)
    y = y / y.std() + 0.3 * scipy.signal.lfilter([1], [1, -0.8], rng.standard_normal(600))
    record = fq.Record(u, y, 0.02)
    for order in range(2, 9):
        free, stable = (fq.fit(fq.OutputError(order, stable=s), record) for s in (False, True))
        assert free.cost <= stable.cost * (1 + 1e-3), order


@pytest.mark.study
def test_lines_that_share_their_noise_are_counted_once():
    """Of a local response every line was taken for a measurement of its own: order 6 or 7 of 7."""
    b, a = np.array([-2.0, 40]), np.polymul([1, 5], [1, 2, 100.0])
    plant = scipy.signal.cont2discrete(scipy.signal.tf2ss(b, a), 0.01)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(4000)
        y = scipy.signal.dlsim((*plant[:4], 0.01), u)[1][:, 0]
        noisy = fq.Record(u, y + 0.05 * y.std() * rng.standard_normal(4000), 0.01)
        table = fq.select_order(fq.local_rational(noisy), range(2, 8))
        assert table.attrs["best"] == 3


@pytest.mark.study
def test_a_delay_one_too_long_is_not_chosen_for_a_pole_that_grows():
    """b/(s + a) 4.3 samples late: behind five samples order 2 has a pole at −340, an advance."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(3000)
        late = np.r_[np.zeros(43), np.repeat(u, 10)][: 10 * len(u)]
        one = np.ones((1, 1))
        fine = scipy.signal.cont2discrete((-100 * one, 100 * one, one, 0 * one), 1e-4)
        y = scipy.signal.dlsim((*fine[:4], 1e-4), late)[1][::10, 0]
        record = fq.Record(u, y + 0.02 * rng.standard_normal(len(u)), 1e-3)
        found = fq.select_order(record, [1, 2], delays=range(7)).attrs
        assert (found["best"], found["delay"]) == (2, 4)


def test_a_plant_that_does_grow_is_chosen_all_the_same():
    """y⁺ = 1.01 y + u, kept small by u = r − 0.2 y."""
    rng = np.random.default_rng(0)
    r, e = rng.standard_normal((2, 1500))
    u, y = np.zeros(1500), np.zeros(1500)
    for k in range(1499):
        u[k] = r[k] - 0.2 * y[k]
        y[k + 1] = 1.01 * y[k] + u[k]
    record = fq.Record(u, y + 0.01 * e, 1e-2)
    table = fq.select_order(record, [1, 2])
    assert table.attrs["best"] == 1
    assert 0 in table.attrs["growing"]


def test_as_many_unknowns_as_values_are_no_order():
    """Ten samples: an order that interpolates them has no residual, and so was the best."""
    record = fq.simulate(fq.first_order(), fq.white_noise(10, seed=1), 1e-2).with_noise(0.01)
    table = fq.select_order(record, range(1, 5), feedthrough=None)
    row = table[(table["order"] == 3) & table["feedthrough"]].iloc[0]
    assert "take up 10 real values" in row["error"]
    assert np.isnan(row["mdl"])
    assert (table.attrs["best"], table.attrs["feedthrough"]) != (3, True)


def test_the_largest_order_says_so():
    """In coloured noise MDL took the largest order in 44 of 44 records, without a word."""
    rng = np.random.default_rng(4)
    noise = scipy.signal.lfilter([0.44], [1, -0.9], rng.standard_normal(800))
    record = fq.simulate(fq.first_order(), fq.white_noise(800, seed=5), 1e-3)
    record = fq.Record(record.u, record.y + 0.3 * record.y.std() * noise, record.dt)
    table = fq.select_order(record, range(1, 4))
    other = fq.select_order(record, range(1, 4), criterion="cross_validation").attrs["best"]
    assert (table.attrs["best"], other) == (3, 1)
    assert "take order 1 of cross-validation" in table.attrs["note"]
    quiet = fq.simulate(fq.first_order(), record.u, 1e-3).with_noise(0.01)
    assert "note" not in fq.select_order(quiet, range(1, 4)).attrs
    assert "note" not in fq.select_order(quiet, [1]).attrs
