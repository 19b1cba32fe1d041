"""What version 0.1.0 wrote is still read: pickles and CSV files made by it."""

import json
import pickle
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq

FOLDER = Path(__file__).parent / "version_0_1_0"


def read(name):
    if name not in ("record", "response", "plant") and int(pd.__version__.split(".")[0]) < 3:
        pytest.skip("the tables in these pickles were written by pandas 3")
    return pickle.loads((FOLDER / f"{name}.pkl").read_bytes())


@pytest.fixture(scope="module")
def values():
    return json.loads((FOLDER / "values.json").read_text())


# these ties held syntax trees, whose pickles Python 3.13 warns of
@pytest.mark.filterwarnings("ignore:.*__init__ missing:DeprecationWarning")
def test_records_responses_and_plants():
    record, frf, plant = read("record"), read("response"), read("plant")
    assert record.n_samples == 240
    assert record.hold == fq.ZeroOrderHold(1e-3)
    assert np.allclose(fq.etfe(record).select((20, 200)).response, frf.response)
    assert plant["Ja"] == pytest.approx(1e4 * plant["Jm"])
    assert plant.parameter("k").prior == (1.5e5, 1e4)
    assert fq.simulate(plant, [1.0, 1.0], 1e-3).n_outputs == 1


def test_estimates_keep_values_and_errors(values):
    est = read("estimate")
    assert est.values.tolist() == values["values"]
    assert est.parameters["std"].tolist() == pytest.approx(values["std"])
    assert est.modes()["frequency"][0] == pytest.approx(est["a"] / (2 * np.pi))
    again = fq.fit(fq.first_order(), est.data[0])
    assert est.values == pytest.approx(again.values, rel=1e-6)
    omega = [50.0, 100.0]
    old, new = (e.frequency_response(omega, fq.ZeroOrderHold(1e-3)) for e in (est, again))
    assert old.variance == pytest.approx(new.variance, rel=0.05)
    with pytest.raises(ValueError, match="from data"):
        est.intervals("profile")


def test_black_boxes_keep_what_had_been_computed(values):
    assert read("black_box").values.tolist() == values["b"]
    assert np.isnan(read("black_box").parameters["std"]).all()
    assert read("black_box_asked").parameters["std"].tolist() == pytest.approx(values["bstd"])
    assert read("transfer_function").values.tolist() == values["t"]
    assert read("transfer_function").model.poles.real.max() < 0


@pytest.mark.parametrize("name", ["with_prior", "in_time"])
def test_estimates_of_every_kind_of_fit(name, values):
    assert read(name).values.tolist() == pytest.approx(values["values"], rel=0.01)
    assert (read(name).parameters["std"] > 0).all()


def test_a_black_box_still_draws_without_its_cost():
    assert read("black_box").frequency_response([50.0]).variance is None


def test_comparisons_and_asymptotic_estimates():
    assert read("comparison").fit_percent[0] > 90
    assert read("asymptotic")["d"] == pytest.approx(-231.4, abs=0.1)


@pytest.mark.parametrize(("name", "dt"), [("slow", 4e-3), ("lifted", 4e-3)])
def test_files_remember_their_hold(name, dt):
    record = fq.read(FOLDER / f"{name}.csv")
    assert record.dt == pytest.approx(dt)
    assert record.hold == fq.ZeroOrderHold(1e-3)
