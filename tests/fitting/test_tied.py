"""Tied parameters stand in the table of an estimate, with the errors that follow."""

import warnings

import numpy as np
import pytest

import freqid as fq

FREE = ["Jm", "k", "fm", "d"]


@pytest.fixture(scope="module")
def record():
    u = fq.chirp(10, 80, 4, 1e-3)
    return fq.simulate(fq.two_mass(), u, 1e-3).with_noise(0.05, seed=3)


def test_a_multiple_has_a_multiple_of_the_error(record):
    est = fq.fit(fq.two_mass().tie(Ja="1e4 * Jm"), record)
    table = est.parameters
    assert list(table.index) == [*FREE, "Ja"]
    np.testing.assert_allclose(
        table.loc["Ja", ["value", "std", "lower", "upper", "nominal"]].astype(float),
        1e4 * table.loc["Jm", ["value", "std", "lower", "upper", "nominal"]].astype(float),
        rtol=1e-9,
    )
    assert table.loc["Ja", "unit"] == "kg m²"
    # what is of the unknowns alone stays so
    assert list(est.names) == FREE
    assert list(est.covariance.index) == FREE


def test_a_product_has_the_error_of_its_gradient(record):
    est = fq.fit(fq.two_mass().tie(d="2e-3 * sqrt(k * Jm)", Ja="1e4 * Jm"), record)
    k, jm, d = est["k"], est["Jm"], est["d"]
    gradient = np.array([d / (2 * k), d / (2 * jm)])
    both = est.covariance.loc[["k", "Jm"], ["k", "Jm"]].to_numpy()
    std = est.parameters["std"]
    assert std["d"] == pytest.approx(np.sqrt(gradient @ both @ gradient), rel=1e-7)


def test_what_data_do_not_tell_leaves_other_ties_known():
    def lag(a, unused, double):
        return [[-a]], [[a + 0 * unused]], [[1.0]], [[0.0]]

    a, unused, double = (fq.Parameter(n, v) for n, v in (("a", 50), ("unused", 1), ("double", 9)))
    plant = fq.GreyBox(lag, [a, unused, double]).tie(double="2 * a")
    data = fq.simulate(plant, fq.white_noise(400, seed=1), 1e-3).with_noise(0.01, seed=2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = fq.fit(plant, data).parameters
    assert np.isinf(table.loc["unused", "std"])
    assert table.loc["double", "std"] == pytest.approx(2 * table.loc["a", "std"], rel=1e-9)


def test_of_separate_values_nothing_follows(record):
    plant = fq.two_mass().tie(Ja="1e4 * Jm", d="1e4 * fm")
    est = fq.fit(plant, [record.slice(0, 2), record.slice(2, 4)], separate=["fm"])
    assert "Ja" in est.parameters.index
    assert "d" not in est.parameters.index


def test_a_kept_estimate_has_them_again(record, tmp_path):
    est = fq.fit(fq.two_mass().tie(Ja="1e4 * Jm"), record)
    est.save(tmp_path / "axis.json")
    again = fq.load(tmp_path / "axis.json").parameters
    np.testing.assert_allclose(
        again.drop(columns="unit").to_numpy(dtype=float),
        est.parameters.drop(columns="unit").to_numpy(dtype=float),
        rtol=1e-12,
    )
    assert est.to_dict()["parameters"]["Ja"]["value"] == pytest.approx(est["Ja"])


def test_a_tie_that_leaves_its_bounds_is_named():
    """The bounds of a tied parameter are none of the search's: nothing was said of them."""
    record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 4, 1e-3), 1e-3).with_noise(0.2, seed=5)
    tied = fq.two_mass().with_bounds(Ja=(10, 12)).tie(Ja="2e4 * Jm")
    est = fq.fit(tied, record)
    assert est.model["Ja"] > 12
    said = [w for w in est.warnings if w.kind == "edge of a bound"]
    assert len(said) == 1
    assert "Ja=" in said[0]
    assert "[10, 12]" in said[0]
    wide = fq.fit(fq.two_mass().with_bounds(Ja=(1, 40)).tie(Ja="2e4 * Jm"), record)
    assert not [w for w in wide.warnings if w.kind == "edge of a bound"]


@pytest.mark.parametrize("option", [{"weights": "noise"}, {"loss": "huber"}])
def test_fits_in_turn_take_ties(option):
    """The values that a fit begins the next from held the tied ones, which was refused."""
    lag = fq.first_order().tie(b="2 * a")
    true = lag.with_values(a=100.0)
    record = fq.simulate(true, fq.chirp(2, 40, 2, 1e-3), 1e-3).with_noise(0.05, seed=3)
    est = fq.fit(lag.with_values(a=80.0), record, **option)
    assert est["a"] == pytest.approx(100, abs=5 * est.parameters["std"]["a"])
    assert est["b"] == pytest.approx(2 * est["a"], rel=1e-12)


def test_an_estimate_of_tied_values_is_a_start(record):
    model = fq.two_mass().tie(Ja="1e4 * Jm")
    est = fq.fit(model, record)
    again = fq.fit(model, record, start=est.parameters["value"].to_dict())
    np.testing.assert_allclose(again.values, est.values, rtol=1e-5)
    with pytest.raises(ValueError, match=r"start: Ja=1.0 is tied to '1e4 \* Jm'"):
        fq.fit(model, record, start={"Ja": 1.0})
