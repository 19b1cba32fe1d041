"""Periodic data with noise on both ends: means, their covariance, and the fit to them."""

import dataclasses
import itertools

import numpy as np
import pytest
import scipy

import freqid as fq

DT = 2e-3
LAG = fq.first_order(b=100.0, a=60.0)
# phases that no optimiser moves
PERIOD = fq.multisine((1, 60), 1, DT, 1, crest="schroeder")


def measured(seed, periods, level=0.1, plant=LAG):
    """A lag behind a multisine, noise at 20 dB on both ends, partly common to them."""
    u = np.tile(PERIOD, periods + 1)
    y = fq.simulate(plant, u, DT, hold="bl").y
    rng = np.random.default_rng(seed)
    own, common = rng.standard_normal((2, len(u))), rng.standard_normal(len(u))
    noisy = [
        x + level * x.std() * (0.8 * e + 0.6 * common) for x, e in zip((u, y), own, strict=True)
    ]
    return fq.Record(*noisy, DT, hold="bl")


@pytest.mark.study
@pytest.mark.parametrize("periods", [4, 8])
def test_noise_on_the_input_leaves_no_bias_and_honest_error_bars(periods):
    off, score, costs = [], [], []
    for seed in range(120):
        est = fq.fit(LAG, fq.periodic(measured(seed, periods), 1.0, skip=1))
        table = est.parameters
        off.append(table["value"] / [100, 60] - 1)
        score.append((table["value"] - [100, 60]) / table["std"])
        costs.append(est.cost / (2 * 60 - 2))
    mean, spread = np.mean(off, axis=0), np.std(off, axis=0) / np.sqrt(len(off))
    assert (np.abs(mean) < np.maximum(6e-4, 3.5 * spread)).all()
    assert np.std(score, axis=0) == pytest.approx([1, 1], abs=0.2)
    freedom = fq.periodic(measured(0, periods), 1.0, skip=1).freedom
    # variances that are estimates themselves raise the cost by ν/(ν − 1)
    assert np.mean(costs) == pytest.approx(0.5 * freedom / (freedom - 1), rel=0.04)


def test_h1_of_the_same_data_is_biased():
    gains = []
    for seed in range(20):
        record = measured(seed, 8, level=0.3)
        h1 = fq.h1(record.slice(1), 500, window="boxcar", band=(1, 60))
        both = [fq.fit(LAG, frf)["b"] / 100 for frf in (h1, fq.periodic(record, 1.0, skip=1))]
        gains.append(both)
    off = np.mean(gains, axis=0) - 1
    assert off[0] < -0.01
    assert abs(off[1]) < 0.01


def test_the_jacobian_is_that_of_the_cost():
    from freqid.fitting.cost.objective import Objective
    from freqid.fitting.cost.structures import GreyStructure
    from freqid.fitting.reading import Reading

    structure = GreyStructure(LAG)
    objective = Objective(structure, [Reading.of(fq.periodic(measured(1, 4), 1.0)).experiment()])
    x = np.array([1.1, 0.85])
    for k in range(2):
        step = np.zeros(2)
        step[k] = 1e-6
        ends = [objective.point(x + s * step).cost for s in (1, -1)]
        point = objective.point(x)
        gradient = 2 * point.jacobian[:, k] @ point.residual
        assert gradient == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)


def two_by_two():
    def matrices(a, b, c, k):
        return [[-a, c], [0.0, -b]], [[k, 0.0], [0.3 * k, 80.0]], np.eye(2), np.zeros((2, 2))

    names = {"a": 40.0, "b": 90.0, "c": 20.0, "k": 60.0}
    return fq.GreyBox(matrices, [fq.Parameter(n, v) for n, v in names.items()])


def test_two_inputs_in_as_many_experiments():
    model, off = two_by_two(), []
    rng = np.random.default_rng(5)
    for _seed in range(10):
        records = []
        for e in range(2):
            each = [fq.multisine((1, 60), 1, DT, 1, "random", seed=4 * e + i) for i in range(2)]
            u = np.tile(np.column_stack(each), (7, 1))
            y = fq.simulate(model, u, DT, hold="bl").y
            u = u + 0.1 * u.std() * rng.standard_normal(u.shape)
            y = y + 0.1 * y.std(axis=0) * rng.standard_normal(y.shape)
            records.append(fq.Record(u, y, DT, hold="bl"))
        frf = fq.periodic(records, 1.0, skip=1)
        assert frf.response.shape == (2, 2, 60)
        est = fq.fit(model, frf)
        off.append((est.values / [40, 90, 20, 60] - 1) / (est.parameters["std"] / est.values))
    assert np.abs(np.mean(off, axis=0)).max() < 1.5
    assert np.std(off) < 1.6
    with pytest.raises(ValueError, match="1 experiments for 2 inputs"):
        fq.periodic(records[0], 1.0)


def in_a_loop(seed, periods=9):
    """The lag under u = r − y with slow noise in the loop."""
    r = np.tile(PERIOD, periods)
    rng = np.random.default_rng(seed)
    v = 0.0
    phi = np.exp(-60 * DT)
    gamma = 100 / 60 * (1 - phi)
    x, u, y = 0.0, np.zeros(len(r)), np.zeros(len(r))
    for k in range(len(r)):
        v = 0.95 * v + 0.1 * rng.standard_normal()
        y[k] = x + v
        u[k] = r[k] - y[k]
        x = phi * x + gamma * u[k]
    return fq.Record(u, y, DT, reference=r)


def test_a_loop_does_no_harm():
    values = [fq.fit(LAG, fq.periodic(in_a_loop(s), 1.0, skip=1)).values for s in range(30)]
    spread = np.std(values, axis=0) / np.sqrt(30)
    assert (np.abs(np.mean(values, axis=0) - [100, 60]) < 3.5 * spread + 0.3).all()


def test_the_period_is_found():
    record = measured(3, 6)
    assert fq.periodic(record).frequency[0] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="does not repeat"):
        fq.periodic(fq.simulate(LAG, fq.white_noise(3000), DT))


def test_what_has_no_noise_to_tell_is_refused():
    with pytest.raises(ValueError, match="two are needed"):
        fq.periodic(measured(0, 1).slice(0, 1.0), 1.0)
    with pytest.raises(ValueError, match="period"):
        fq.periodic(measured(0, 3), 0.0015)
    frf = fq.periodic(measured(0, 4), 1.0)
    with pytest.raises(ValueError, match="noise has shape"):
        fq.PeriodicResponse(**{**frf.__dict__, "noise": frf.noise[:, :3]})


def test_black_boxes_and_bands_take_it_too():
    frf = fq.periodic(measured(2, 8), 1.0, skip=1)
    assert fq.fit(fq.TransferFunction(0, 1), frf).model.poles.real == pytest.approx([-60], rel=0.05)
    held = dataclasses.replace(frf.plain(), hold=fq.ZeroOrderHold(DT))
    assert fq.fit(fq.OutputError(1), held).converged
    part = fq.fit(LAG, frf, band=(5, 40))
    assert part["a"] == pytest.approx(60, rel=0.05)
    assert fq.fit(LAG, frf, weights="noise")["a"] == fq.fit(LAG, frf)["a"]


def test_the_aircraft_depends_on_its_level(measured):
    """All lines from 2 to 15 Hz were excited; the wing torsion near 7.3 Hz falls with the level."""
    import scipy.io

    runs = []
    for level in (1, 3):
        data = scipy.io.loadmat(
            measured / "f16" / f"F16Data_FullMSine_Level{level}.mat", squeeze_me=True
        )
        runs.append(
            fq.Record(
                data["Force"], data["Acceleration"].T, 1 / 400, hold="bl", reference=data["Voltage"]
            )
        )
    for reference in (None, True):
        found = fq.distortion(runs[1], 8192 / 400, skip=1, reference=reference, band=(1, 60))
        # peaks at 16.5 and 43 Hz were the shaker's own distortion
        assert len(found.response.frequency) == 267
        assert found.response.frequency[-1] < 15
        assert found.method == "noise"
    both = fq.distortion(runs, 8192 / 400, skip=1, reference=True, band=(1, 60))
    assert 7.2 < both.levels["frequency"].iloc[1] < 7.5
    assert "depends on the amplitude" in both.warnings[0]


def test_a_period_that_is_none_is_refused_by_name():
    """Half of the true one, and that of another record."""
    u = fq.multisine((2, 100), 1.0, 1e-3, 6, crest="random", seed=2)
    record = fq.simulate(fq.first_order(), u, 1e-3).with_noise(0.01, seed=1)
    assert fq.periodic(record, period=1.0).response.shape[-1] == 99
    # two of the true ones are a period, too
    assert fq.periodic(record, period=2.0).response.shape[-1] == 99
    with pytest.raises(ValueError, match=r"repeats after 1 s; .* [45]\d % of its power"):
        fq.periodic(record, period=0.5)
    other = fq.multisine((2, 100), 0.8, 1e-3, 6, crest="random", seed=3)
    second = fq.simulate(fq.first_order(), other, 1e-3).with_noise(0.01, seed=2)
    with pytest.raises(ValueError, match=r"records\[1\]: only \d+ % of the excitation"):
        fq.periodic([record, second])
    # as much noise as signal on the input is no other period
    rng = np.random.default_rng(0)
    noisy = fq.Record(
        record.u + record.u.std() * rng.standard_normal(len(record.u)), record.y, 1e-3
    )
    assert fq.periodic(noisy, period=1.0).response.shape[-1] > 10


@pytest.mark.study
def test_error_bars_of_several_outputs_hold():
    """The covariance of three outputs, from three periods, is a worse estimate than that of one."""

    def matrices(a, b1, b2, b3):
        return [[-a]], [[1.0]], [[b1], [b2], [b3]], np.zeros((3, 1))

    true = {"a": 60.0, "b1": 100.0, "b2": 40.0, "b3": 70.0}
    plant = fq.GreyBox(matrices, [fq.Parameter(n, v) for n, v in true.items()])
    u = np.tile(PERIOD, 4)
    clean, score = fq.simulate(plant, u, DT, hold="bl").y, []
    for seed in range(250):
        rng = np.random.default_rng(seed)
        mixed = rng.standard_normal(clean.shape) @ [[1.0, 0.6, 0], [0, 1.0, 0.6], [0, 0, 1.0]]
        y = clean + 0.1 * clean.std(axis=0) * mixed
        est = fq.fit(plant, fq.periodic(fq.Record(u, y, DT, hold="bl"), 1.0, skip=1), n_starts=1)
        score.append((est.values - list(true.values())) / est.parameters["std"])
    assert np.sqrt(np.mean(np.square(score))) == pytest.approx(1, abs=0.06)


def test_error_bars_do_not_depend_on_the_order_of_the_outputs():
    gains, names = {"p": 100.0, "q": 40.0, "r": 70.0}, ["p", "q", "r"]

    def plant(order):
        return fq.GreyBox(
            lambda a, g: ([[-a]], [[1.0]], [[gains[n] * g] for n in order], np.zeros((3, 1))),
            [fq.Parameter("a", 60.0), fq.Parameter("g", 1.0)], outputs=order,
        )  # fmt: skip

    clean = fq.simulate(plant(names), np.tile(PERIOD, 5), DT, hold="bl")
    rng = np.random.default_rng(1)
    mixed = rng.standard_normal(clean.y.shape) @ [[1.0, 0.6, 0], [0, 1.0, 0.6], [0, 0, 1.0]]
    noisy = fq.Record(
        clean.u, clean.y + 0.1 * clean.y.std(axis=0) * mixed, DT, hold="bl", output_names=names
    )
    frf = fq.periodic(noisy, 1.0, skip=1)
    own = fq.fit(plant(names), frf)
    for order in itertools.permutations(names):
        est = fq.fit(plant(list(order)), frf)
        np.testing.assert_allclose(est.values, own.values, rtol=1e-7)
        np.testing.assert_allclose(est.parameters["std"], own.parameters["std"], rtol=1e-6)


def test_a_slow_output_keeps_its_fast_input():
    """Commands at 1 kHz, a sensor at 250 Hz, in a loop: as exact as with all of the output."""
    h, M = 1e-3, 4
    r = np.tile(fq.multisine((1, 120), 1.0, h, 1, crest="random"), 5)
    phi = np.exp(-60 * h)
    x, u, y = 0.0, np.zeros(len(r)), np.zeros(len(r))
    for k in range(len(r)):
        y[k] = x
        u[k] = r[k] - y[k]
        x = phi * x + 100 / 60 * (1 - phi) * u[k]
    slow = fq.Record(u, y[::M], M * h, input_dt=h)
    frf = fq.periodic(slow, skip=2)
    assert frf.frequency[-1] == pytest.approx(120)
    assert frf.dt == pytest.approx(h)
    assert fq.fit(LAG, frf).values == pytest.approx([100, 60], rel=1e-9)
    assert fq.fit(LAG, fq.periodic(fq.Record(u, y, h), skip=2)).values == pytest.approx(
        [100, 60], rel=1e-9
    )


def test_power_above_the_slow_nyquist_frequency_is_left_out_or_refused():
    h, M = 1e-3, 4
    both = sum(fq.multisine(b, 1.0, h, crest="schroeder") for b in ((1, 100), (160, 200)))
    record = fq.simulate(LAG, np.tile(both, 5), h).decimate(M, keep_input=True)
    frf = fq.periodic(record, 1.0, skip=1)
    assert frf.frequency == pytest.approx(np.r_[1:50, 91:101])
    assert fq.fit(LAG, frf).values == pytest.approx([100, 60], rel=1e-9)
    with pytest.raises(ValueError, match="Nyquist frequency of 125 Hz folded onto it"):
        fq.periodic(record, 1.0, skip=1, band=(50, 90))
    odd = fq.simulate(LAG, fq.multisine((1, 100), 0.902, h, 5, crest="schroeder"), h).decimate(
        M, keep_input=True
    )
    with pytest.raises(ValueError, match="no whole number of the output's samples"):
        fq.periodic(odd)


def test_a_small_line_that_falls_on_a_small_one_is_left_out():
    """A line of 0.9e-3 of the strongest onto one of 1.5e-3."""
    h, n, M = 2e-3, 100, 2
    k = np.arange(n * M)
    lines = ((3, 1.0), (7, 1.5e-3), (93, 0.9e-3))
    u = sum(A * np.cos(2 * np.pi * line * k / (n * M)) for line, A in lines)
    record = fq.simulate(LAG, np.tile(u, 9), h).decimate(M, keep_input=True)
    frf = fq.periodic(record, n * M * h, skip=3)
    assert frf.frequency == pytest.approx([3 / (n * M * h)])


def test_power_above_the_nyquist_frequency_alone_is_no_excitation():
    h = 1e-3
    record = fq.simulate(LAG, fq.multisine((130, 240), 1.0, h, 6, "schroeder"), h).decimate(
        4, keep_input=True
    )
    with pytest.raises(ValueError, match="no energy in band"):
        fq.periodic(record, 1.0, skip=1)


def test_a_reference_is_checked_and_may_be_as_fast_as_the_input():
    h, M = 1e-3, 4
    u = fq.multisine((1, 100), 1.0, h, 6, "schroeder")
    record = fq.simulate(LAG, u, h).decimate(M, keep_input=True)
    one, other = (fq.periodic(record, 1.0, r, skip=1) for r in (u, u[::M]))
    assert np.array_equal(one.response, other.response)
    with pytest.raises(ValueError, match="reference must be finite"):
        fq.periodic(record, 1.0, np.full(len(u), np.nan))


@pytest.mark.study
@pytest.mark.parametrize(("lines", "periods", "pole"), [(3, 8, 0.0), (60, 3, 0.8)])
def test_error_bars_of_few_lines_and_of_coloured_noise(lines, periods, pole):
    u = np.tile(fq.multisine((5, 4 + lines), 1, DT, 1, crest="schroeder"), periods + 1)
    clean, score = fq.simulate(LAG, u, DT, hold="bl").y, []
    for seed in range(150):
        e = np.random.default_rng([seed, lines]).standard_normal(len(u))
        noise = scipy.signal.lfilter([1], [1, -pole], e)
        record = fq.Record(u, clean + 0.1 * clean.std() * noise, DT, hold="bl")
        est = fq.fit(LAG, fq.periodic(record, 1.0, skip=1), n_starts=1)
        score.append((est.values - [100, 60]) / est.parameters["std"])
    assert np.sqrt(np.mean(np.square(score))) == pytest.approx(1, abs=0.15)


def test_the_witness_of_outputs_that_share_their_noise():
    """Each line's errors are those of all its entries: chance, and no better minimum."""
    model, p = two_by_two(), []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        records = []
        for e in range(2):
            each = [fq.multisine((1, 60), 1, DT, 1, "random", seed=4 * e + i) for i in range(2)]
            u = np.tile(np.column_stack(each), (5, 1))
            y = fq.simulate(model, u, DT, hold="bl").y
            noise = rng.standard_normal((len(y), 1)) * [1.0, 0.9] + 0.1 * rng.standard_normal(
                y.shape
            )
            records.append(fq.Record(u, y + 0.05 * y.std(axis=0) * noise, DT, hold="bl"))
        est = fq.fit(model, fq.periodic(records, 1.0, skip=1), n_starts=1)
        p.append(est.witness.p_value)
    assert np.mean(np.array(p) < 0.05) < 0.2
    assert min(p) > 1e-4


def test_the_noise_of_few_periods_in_a_loop_is_told_next_to_a_resonance():
    """Noise that a loop takes to the input is as peaked as the plant, what it leaves is not."""
    plant = fq.GreyBox(
        lambda w, z: ([[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[1, 0]], [[0]]),
        [fq.Parameter("w", 157.0), fq.Parameter("z", 0.05)],
    )
    r = np.tile(fq.multisine((1, 60), 2.0, DT, crest="schroeder"), 4)
    clean, far = fq.simulate(plant, r, DT).y, []
    for seed in range(40):
        e = 0.05 * clean.std() * np.random.default_rng(seed).standard_normal(len(r))
        u = r - e
        g = fq.periodic(fq.Record(u, fq.simulate(plant, u, DT).y + e, DT), 2.0, r, skip=1)
        near = g.select((18, 32))
        true = plant.frequency_response(near.omega, fq.ZeroOrderHold(DT)).response
        far.append(np.abs(near.response - true)[0, 0] ** 2 / near.variance[0, 0])
    each = np.mean(far, axis=0)
    assert 0.6 < each.mean() < 1.1
    assert each.min() > 0.2


@pytest.mark.study
@pytest.mark.parametrize("offset", [0.0, 10.0, 1e4])
@pytest.mark.parametrize("referred", [False, True])
def test_an_offset_of_the_input_takes_no_lines_away(offset, referred):
    """It once was the strongest line, beside which others were none: silently, or all of them."""
    rng = np.random.default_rng(0)
    u = fq.multisine((1, 199), 1.0, 1e-3, periods=6)
    record = fq.simulate(fq.first_order(), u, 1e-3, hold="bl").with_noise(1e-4)
    moved = fq.Record(
        record.u + offset + 1e-4 * rng.standard_normal(len(u)), record.y, 1e-3, "bl",
        reference=record.u + offset if referred else None,
    )  # fmt: skip
    found = fq.periodic(moved, 1.0)
    assert found.frequency.tolist() == list(range(1, 200))
    assert found.response == pytest.approx(fq.periodic(record, 1.0).response, rel=0.05)


def test_single_periods_are_told_where_they_belong():
    whole = measured(0, 4)
    n = len(PERIOD)
    parts = [slice(i * n, (i + 1) * n) for i in range(4)]
    single = [fq.Record(whole.u[part], whole.y[part], DT, hold="bl") for part in parts]
    # without a word of numpy's beside it
    with pytest.raises(ValueError, match=r"0 periods of 1000 s \(500000 samples\)"):
        fq.periodic(measured(0, 3), period=1000.0)
    with pytest.raises(ValueError, match=r"join periods that followed .* by etfe"):
        fq.periodic(single, 1.0)
    joined = fq.Record(*(np.concatenate([getattr(r, x) for r in single]) for x in "uy"), DT)
    together, averaged = fq.periodic(joined, 1.0), fq.etfe(single)
    at = np.searchsorted(averaged.frequency, together.frequency - 1e-9)
    np.testing.assert_allclose(together.response, averaged.response[..., at], rtol=0.05)


@pytest.mark.parametrize(("power", "odd"), [(3, True), (2, False)])
def test_even_lines_say_nothing_of_odd_distortion(power, odd):
    """They were taken for it: of a cubic plant variances were 70 times too small, of a square 30
    times too large, without a word.
    """
    scatter, stated = [], []
    for seed in range(8):
        u = fq.multisine((1, 60), 1.0, 1e-3, 3, "random", seed=seed, grid="odd")
        bent = u + 0.05 * u**power
        r = fq.simulate(fq.first_order(), bent, 1e-3)
        found = fq.distortion(fq.Record(u, r.y, 1e-3).with_noise(0.002, seed=seed), 1.0, skip=1)
        assert found.method == "noise"
        assert "what odd distortion adds" in found.warnings[0]
        excited = found.table[found.table["line"] == "excited"]
        assert excited["distortion"].isna().all()
        even = found.table[found.table["line"] == "even"]["distortion"].median()
        assert (even > 5e-4) == (power == 2)
        scatter.append(found.response.response[0, 0])
        stated.append(found.response.variance[0, 0])
    ratio = np.var(scatter, axis=0).mean() / np.mean(stated)
    assert (ratio > 3) == odd
