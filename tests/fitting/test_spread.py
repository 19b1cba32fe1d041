"""How far numbers move between parts of the data, and error bars that know of it."""

import numpy as np
import pytest

import freqid as fq

K = 40.0


def _mode(w, z, g):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g * w * w, 0]], [[0]]


MODE = fq.GreyBox(_mode, [fq.Parameter("w", K), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0)])


def _record(w, seed, n=800, dt=0.01, noise=0.03):
    record = fq.simulate(MODE.with_values(w=w), fq.white_noise(n, seed=seed), dt)
    return record.with_noise(noise * record.y.std(), seed=seed + 1)


@pytest.mark.study
def test_good_data_keep_their_error_bars():
    """At the level of 0.001: one of 60 data sets in a thousand runs of 60."""
    wider = 0
    for seed in range(20):
        for data in (_record(K, seed), [_record(K, seed), _record(K, seed + 500)]):
            spread = fq.fit(MODE, data).spread
            assert {"record halves", "band halves"} <= set(spread.index.get_level_values(0))
            wider += bool((spread["widened"] > spread["std"]).any())
    assert wider <= 1


@pytest.mark.study
@pytest.mark.parametrize("scatter", [0.002, 0.02])
def test_machines_that_differ_widen_the_error_bar(scatter):
    """Five runs, each with a frequency of its own: the mean is off by scatter/√5."""
    told, widened = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        data = [_record(K * (1 + scatter * rng.standard_normal()), 10 * seed + i) for i in range(5)]
        est = fq.fit(MODE, data)
        row = est.spread.loc[("experiments", "w")]
        told.append(abs(est["w"] / K - 1) / (row["std"] / K))
        widened.append(abs(est["w"] / K - 1) / (row["widened"] / K))
        assert row["parts"] == 5
        assert row["p_value"] < 1e-3
        assert row["std"] == est.parameters.loc["w", "std"]
    # a mean of five with its own scatter: t on four degrees of freedom beyond 2.78 in one of 20
    assert np.sum(np.array(widened) > 2.78) <= 2
    assert np.median(told) > 1.5 * np.median(widened)


def test_what_changes_half_way_shows_between_the_halves_of_the_record():
    first, second = _record(K, 1), _record(1.01 * K, 2)
    joined = fq.Record(np.append(first.u, second.u), np.append(first.y, second.y), 0.01)
    spread = fq.fit(MODE, joined).spread
    row = spread.loc[("record halves", "w")]
    assert row["percent"] == pytest.approx(1.0, abs=0.2)
    assert row["p_value"] < 1e-6
    assert row["widened"] > 0.003 * K > row["std"]


def test_a_model_that_lacks_a_mode_moves_between_the_halves_of_the_band():
    u = fq.white_noise(2000, seed=3)
    second = fq.simulate(MODE.with_values(w=110.0, g=0.3), u, 0.01).y
    record = fq.simulate(MODE, u, 0.01)
    record = fq.Record(u, record.y + second, 0.01).with_noise(0.01, seed=4)
    spread = fq.fit(MODE, record).spread
    assert spread.loc["band halves"]["p_value"].iloc[0] < 1e-3


def test_half_of_a_sweep_that_lacks_the_resonance_says_nothing_of_it():
    """Its own fit ends anywhere, with error bars that hold only next to it."""
    for seed in range(6):
        record = fq.simulate(MODE, fq.chirp(1, 30, 15, 0.01), 0.01)
        spread = fq.fit(MODE, record.with_noise(record.y.std() / 10, seed=seed)).spread
        assert (spread["widened"] == spread["std"]).all()


def test_a_prior_is_told_to_no_part():
    believed = MODE.with_prior(w=(K, 0.01))
    data = [_record(0.98 * K, 5), _record(1.02 * K, 6)]
    row = fq.fit(believed, data).spread.loc[("experiments", "w")]
    assert row["percent"] == pytest.approx(4.0, abs=0.3)


def test_black_boxes_have_their_modes_compared():
    data = [_record(K, 7), _record(1.03 * K, 8)]
    spread = fq.fit(fq.OutputError(2), data).spread
    row = spread.loc[("experiments", "frequency 1")]
    assert row["percent"] == pytest.approx(3.0, abs=0.4)
    assert row["widened"] > row["std"]


def test_a_pole_that_channels_share_is_one_mode():
    rng = np.random.default_rng(1)
    one = _record(K, 3, n=1500)
    both = fq.Record(one.u, np.column_stack([one.y, 2 * one.y]) + 0.02 * rng.standard_normal(
        (1500, 2)), 0.01)  # fmt: skip
    spread = fq.fit(fq.TransferFunction(1, 2), both, band=(1, 40)).spread
    assert {"frequency 1"} <= set(spread.loc["record halves"].index)
    assert "frequency 2" not in spread.loc["record halves"].index
    assert (spread["widened"] == spread["std"]).all()


def test_weights_and_values_of_their_own_are_parted_too():
    data = [_record(K, 9), _record(1.02 * K, 10)]
    weighted = fq.fit(MODE, data, weights="noise").spread
    assert weighted.loc[("experiments", "w"), "percent"] == pytest.approx(2.0, abs=0.3)
    assert "record halves" in weighted.index.get_level_values(0)
    apart = fq.fit(MODE, data, separate="w").spread
    assert set(apart.index.get_level_values(1)) == {"z", "g"}


def test_what_a_prior_knows_is_not_widened_by_parts_that_are_not_told_it():
    given = MODE.with_prior(g=(1.0, 1e-5))
    data = [_record(K, 31), _record(1.03 * K, 32)]
    rows = fq.fit(given, data).spread.loc["experiments"]
    assert rows.loc["w", "widened"] > 2 * rows.loc["w", "std"]
    assert rows.loc["g", "widened"] < 3 * rows.loc["g", "std"]


def test_without_data_or_noise_the_table_is_empty_with_its_columns(tmp_path):
    est = fq.fit(MODE, [_record(K, 11), _record(1.1 * K, 12)])
    columns = list(est.spread.columns)
    est.save(tmp_path / "est.json")
    clean = fq.simulate(MODE, fq.white_noise(400), 0.01)
    others = fq.load(tmp_path / "est.json"), fq.fit(MODE, clean), fq.fit(fq.OutputError(2), clean)
    for other in others:
        assert other.spread.empty
        assert list(other.spread.columns) == columns
        assert list(other.spread.index.names) == ["between", "parameter"]


@pytest.mark.study
def test_experiments_that_share_no_resonance_are_named():
    """A tenth apart, each half a per cent wide: from between them one step tells nothing."""
    for seed in range(4):
        data = [_record(K, 20 + seed, noise=0.01), _record(1.1 * K, 40 + seed, noise=0.01)]
        est = fq.fit(MODE, data)
        assert est.warnings[0].kind == "unlike experiments", est
        assert not est.verdict.trusted
