"""Fits from far away, and what they say of it. The long version is benchmarks/run.py."""

import numpy as np
import pytest

import freqid as fq

BAND = (10, 80)


def scattered(model, factor, count, seed=3):
    rng = np.random.default_rng(seed)
    names = [p.name for p in model.free_parameters]
    for _ in range(count):
        yield {n: model[n] * factor ** rng.uniform(-1, 1) for n in names}


@pytest.mark.study
@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_starts_within_a_factor_of_ten_reach_the_best_cost(plant, slow, hold, seed):
    best = fq.fit(plant, slow, hold=hold, band=BAND).cost
    for start in scattered(plant, 10, 5, seed):
        assert fq.fit(plant, slow, hold=hold, band=BAND, start=start).cost <= best * 1.001


@pytest.mark.parametrize("first", [1.5, 1 / 1.5])
def test_a_start_alternately_too_high_and_too_low_never_fails(
    plant, fast, slow, first, relative_error
):
    factors = [first, 1 / first] * 3
    start = {p.name: p.value * f for p, f in zip(plant.free_parameters, factors, strict=False)}
    assert relative_error(fq.fit(plant, fast, band=BAND, start=start), plant) < 1e-8
    assert relative_error(fq.fit(plant, slow, band=BAND, start=start), plant) < 2e-3


def test_a_three_mass_drivetrain_from_a_factor_of_three(relative_error):
    plant = fq.drivetrain(3)
    record = fq.simulate(plant, fq.chirp(2, 100, 10, 1e-3), 1e-3)
    for start in scattered(plant, 3, 5):
        est = fq.fit(plant, record, band=(2, 100), start=start)
        assert relative_error(est, plant) < 1e-6


def test_data_explained_to_their_noise_need_one_start(plant, fast, slow):
    assert fq.fit(plant, fast, band=BAND).n_starts == 1
    assert fq.fit(plant, slow.with_noise(1), band=BAND).n_starts == 1
    # a wrong hold explains nothing: two starts have to agree
    wrong = fq.fit(plant, slow, hold="zoh", band=BAND)
    assert wrong.n_starts >= 2
    assert wrong.n_agreed >= 2


def test_more_starts_are_never_worse_and_are_repeatable(plant, slow):
    start = {"Jm": 9e-3, "k": 1.5e4, "Ja": 60, "fm": 1e-2, "d": 1.5}
    one = fq.fit(plant, slow, hold="zoh", band=BAND, start=start, n_starts=1)
    eight = fq.fit(plant, slow, hold="zoh", band=BAND, start=start, n_starts=8, seed=5)
    again = fq.fit(plant, slow, hold="zoh", band=BAND, start=start, n_starts=8, seed=5)
    assert (one.n_starts, eight.n_starts) == (1, 8)
    assert eight.cost <= one.cost * (1 + 1e-9)
    assert np.array_equal(eight.values, again.values)


def test_scattered_starts_stay_inside_bounds(slow):
    inside = fq.two_mass().with_bounds(
        Jm=(1e-4, 1e-2), k=(1e4, 1e6), Ja=(1, 100), fm=(1e-5, 1), d=(-500, 100)
    )
    est = fq.fit(inside, slow, hold="zoh", band=BAND, start={"k": 4e5, "Ja": 40})
    assert est["d"] == pytest.approx(-235.18, abs=0.1)
    with pytest.raises(ValueError, match="outside its bounds"):
        fq.fit(inside, slow, start={"k": 5e6})


@pytest.mark.study
def test_no_step_leaves_the_bounds(plant, slow):
    """Also where the cost outside is lower and a Gauss-Newton step would go there."""
    free = fq.fit(plant, slow, hold="foh", band=BAND)
    for name in free.names:
        value = free[name]
        limit = value + 0.02 * abs(value)
        bounds = {name: (limit, limit + 100 * abs(value))}
        bounded = plant.with_values(**{name: limit * 1.5 if limit > 0 else 1e-3})
        est = fq.fit(bounded.with_bounds(**bounds), slow, hold="foh", band=BAND)
        assert est[name] >= limit
        assert est.cost > free.cost


def test_long_records_are_refined_on_all_lines(plant, relative_error):
    record = fq.simulate(plant, fq.chirp(10, 80, 60, 1e-3), 1e-3)
    assert relative_error(fq.fit(plant, record, band=BAND, start={"k": 1.9e5}), plant) < 1e-8
    noisy = record.with_noise(1.0)
    est = fq.fit(plant, noisy, band=BAND, start={"k": 1.9e5})
    best = fq.fit(plant, noisy, band=BAND, start=est.model.values, n_starts=1)
    assert est.cost == pytest.approx(best.cost, rel=1e-9)


def test_a_narrow_band_of_a_long_record_is_the_same_dft(rng):
    from freqid.frf.spectra import dft_at

    for N in (2**16, 2**19):
        x = rng.standard_normal((2, N))
        lines = np.arange(N // 50, N // 20)
        full = np.fft.rfft(x)[:, lines]
        assert np.abs(dft_at(x, lines) - full).max() < 1e-12 * np.abs(full).max()


@pytest.mark.parametrize("period", [None, 2, 4])
def test_the_noise_floor_is_the_noise_that_was_added(plant, period):
    """Over K lines of weight 1 white noise of σ costs 2 K σ², whichever lines are left out."""
    from freqid.fitting.noise_models import GivenWeights
    from freqid.fitting.reading import Reading
    from freqid.fitting.search.noise_floor import noise_floor

    record = fq.simulate(plant, fq.chirp(10, 80, 40, 5e-4), 5e-4).with_noise(0.3, seed=2)
    weights = np.ones(2801)
    if period is not None:
        weights[::period] = 0
    experiment = Reading.of(record, band=(10, 80), noise=GivenWeights(weights)).lines()
    assert noise_floor([experiment]) == pytest.approx(2 * weights.sum() * 0.3**2, rel=0.2)
