"""The short version of the studies in ``benchmarks/search``: a few cases of each."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq


@pytest.fixture(scope="module")
def studies(benchmarks):
    from search import minima, orders, store, witness

    return minima, orders, store, witness


def test_a_study_goes_on_where_it_was_interrupted(studies, tmp_path):
    store, calls = studies[2], []

    def one(case):
        calls.append(case)
        return {"twice": 2 * case}

    store.resumed(tmp_path / "x.csv", range(3), one)
    table = store.resumed(tmp_path / "x.csv", range(5), one)
    assert calls == [0, 1, 2, 3, 4]
    assert table["twice"].tolist() == [0, 2, 4, 6, 8]


@pytest.mark.study
def test_random_plants_are_found_or_doubted(studies):
    minima = studies[0]
    table = pd.DataFrame([minima.one(case) for case in range(3000, 3012)])
    told = table[table["spread"] < minima.DETERMINED]
    assert len(told) > 6
    lost = told["cost"] > told["best"] * (1 + minima.WORSE)
    assert lost.sum() <= 1
    assert not (lost & (told["verdict"] == "complete")).any()
    assert (table["cost"] <= table["own"] * (1 + 1e-6)).all()


@pytest.mark.study
def test_orders_and_witness(studies):
    _, orders, _, witness = studies
    assert [orders.one(case)["mdl"] for case in range(3)] == [4, 4, 4]
    assert all(0 <= witness.one(case)["p"] <= 1 for case in range(4))


@pytest.mark.parametrize("case", range(9))
def test_responses_come_as_near_as_their_noise_allows(benchmarks, case):
    """Orders 4 to 12 without a sample time: the noise, seen through the tangent at the truth."""
    from search import responses

    order, poles, residues, s, G, noise, std = responses.experiment(case)
    frf = fq.FrequencyResponse(s.imag / (2 * np.pi), G + noise, variance=std**2)
    est = fq.fit(fq.TransferFunction(order - 1, order), frf, weights="noise")
    off = est.model.frequency_response(s.imag).response - G
    bound = responses.cramer_rao(poles, residues, s, noise[0, 0], std[0, 0])
    assert np.linalg.norm(off / std) <= 1.1 * bound


def test_the_grid_of_times_is_drawn(benchmarks, tmp_path):
    from search import speed

    cells = [speed.CASES[i] for i in range(0, len(speed.CASES), 7)]
    table = pd.DataFrame(
        {
            "samples": [c[0] for c in cells],
            "start": [c[2] for c in cells],
            "reading": [c[3] for c in cells],
            "ratio": np.linspace(0.1, 9, len(cells)),
            "leastsq_right": True,
        }
    )
    speed.picture(table, tmp_path / "grid.png")
    assert (tmp_path / "grid.png").stat().st_size > 5000
    assert len(list(speed.grid(table))) == len(speed.READINGS)


@pytest.mark.parametrize("case", [1157, 1525, 2618])
def test_what_goes_down_with_the_others_is_no_minimum_that_they_agree_on(studies, case):
    """On few lines the best so far went to the minimum, 80 to 2,600 times below, with a dozen."""
    from search import plants

    plant, record, _, rng = plants.random_experiment(case)
    est = fq.fit(plant, record, start=plants.moved(plant, rng, 3.0))
    assert est.cost <= fq.fit(plant, record, n_starts=1).cost * (1 + 1e-6)
    assert est.witness.verdict == "complete"


@pytest.mark.study
@pytest.mark.parametrize("case", [540, 582, 586, 1198])
def test_plants_whose_black_box_was_lost_itself(studies, case):
    """A weak mode in noise, an open mass, a lost mass, and steps whose few lines mislead."""
    from search import plants

    plant, record, _, rng = plants.random_experiment(case)
    est = fq.fit(plant, record, start=plants.moved(plant, rng, 3.0))
    from_truth = fq.fit(plant, record, n_starts=1)
    assert est.cost <= from_truth.cost * (1 + studies[0].WORSE)


@pytest.mark.study
@pytest.mark.parametrize("case", [135, 46, 203])
def test_plants_that_the_data_leave_open_are_not_called_complete(studies, case):
    """Costs 0.2 to 3 % above another minimum, in noise as large as the signal."""
    from search import plants

    plant, record, _, rng = plants.random_experiment(case)
    est = fq.fit(plant, record, start=plants.moved(plant, rng, 3.0))
    least = min(est.cost, fq.fit(plant, record).cost, fq.fit(plant, record, n_starts=30).cost)
    missed = est.cost > least * (1 + studies[0].WORSE)
    assert not (missed and est.witness.verdict == "complete")


def test_a_valley_without_an_end_is_not_unanimity(studies):
    """Every start of a dozen drifts along it, to one cost, and the minimum is elsewhere."""
    from search import plants

    plant, record, _, rng = plants.random_experiment(1180)
    slow = fq.Record(record.u[::5], record.y[::5], 5 * record.dt, hold="zoh")
    est = fq.fit(plant, slow, start=plants.moved(plant, rng, 3.0))
    best = fq.fit(plant, slow, n_starts=100)
    assert est.cost <= best.cost * (1 + studies[0].WORSE)
