"""What is asked of estimates, fleets and starts that they cannot answer, and is told by name."""

import dataclasses

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.residuals import errors_at_stamps, line_errors

PLANT = fq.first_order()
RECORD = fq.simulate(PLANT, fq.chirp(2, 40, 1.0, 5e-3), 5e-3).with_noise(0.01)


@pytest.fixture(scope="module")
def box():
    return fq.fit(fq.OutputError(1), RECORD)


def test_a_black_box_has_no_functions_of_parameters(box):
    with pytest.raises(ValueError, match="a function of parameters needs a grey-box estimate"):
        box.derived(lambda model: model["a"])


def test_an_estimate_whose_cost_was_let_go(box):
    alone = dataclasses.replace(box, problem=None)
    with pytest.raises(ValueError, match="does not hold its cost any more; fit again"):
        _ = alone.minimum
    kept = dataclasses.replace(fq.fit(PLANT, RECORD), problem=None)
    with pytest.raises(ValueError, match="profile intervals need the data"):
        kept.intervals(method="profile")
    # what needs no data is still told
    whole = fq.fit(PLANT, RECORD)
    np.testing.assert_allclose(kept.modes()["frequency"], whole.modes()["frequency"])


def test_a_fleet_of_one_and_of_twins(tmp_path):
    fq.write(RECORD, tmp_path / "a.csv")
    one = fq.fit_many(PLANT, tmp_path / "a.csv")
    assert len(one) == 1
    assert one["a"].iloc[0] == pytest.approx(fq.fit(PLANT, RECORD)["a"], rel=1e-6)
    same = fq.fit_many(PLANT, RECORD)
    assert same["a"].iloc[0] == pytest.approx(one["a"].iloc[0], rel=1e-6)
    with pytest.raises(ValueError, match=r"records: .*a\.csv is there twice"):
        fq.fit_many(PLANT, [tmp_path / "a.csv"] * 2)


def test_a_finished_fleet_is_read_back(tmp_path):
    table = fq.fit_many(PLANT, {"x": RECORD, "y": RECORD}, tmp_path / "t.parquet")
    again = fq.fit_many(PLANT, {"x": RECORD, "y": RECORD}, tmp_path / "t.parquet")
    np.testing.assert_array_equal(again["a"], table["a"])


def test_starts_of_what_each_experiment_has_for_itself():
    runs = [RECORD, RECORD.with_noise(0.01, seed=5)]
    with pytest.raises(ValueError, match=r"start='b\[2\]'.*b\[0\]"):
        fq.fit(PLANT, runs, separate=["b"], start={"b[2]": 3.0})
    with pytest.raises(ValueError, match="hold='estimate' needs experiments that differ in their"):
        fq.fit(PLANT, runs, separate=["b"], hold="estimate")
    est = fq.fit(PLANT, runs, separate=["b"], start={"b[1]": 90.0})
    assert {"a", "b[0]", "b[1]"} == set(est.names)


def test_places_that_no_experiment_can_have():
    late = dataclasses.replace(
        PLANT, parameters=[*PLANT.parameters, fq.Parameter("Td", 1e-3)], input_delay="Td"
    )
    runs = [RECORD, RECORD.with_noise(0.01, seed=5)]
    with pytest.raises(ValueError, match="separate='Td' is a delay, which all experiments share"):
        fq.fit(late, runs, separate=["Td"])
    tied = dataclasses.replace(PLANT, ties={"b": "2 * a"})
    with pytest.raises(ValueError, match="condition 'b' is tied to '2 \\* a' in the model"):
        fq.fit(tied, [run.with_conditions(b=90.0) for run in runs])


def test_errors_at_stamps_need_a_plant_in_continuous_time(box):
    t = np.cumsum(5e-3 + 1e-3 * np.random.default_rng(1).random(len(RECORD.u)))
    stamped = fq.Record.from_logs(t, RECORD.u, t + 1e-3 * np.sin(9 * t), RECORD.y)
    with pytest.raises(ValueError, match=r"continuous time without delays; take record\.regular"):
        errors_at_stamps(box.model, stamped, None)
    with pytest.raises(ValueError, match=r"band needs a grid; take record\.regular\(\)"):
        fq.compare(PLANT, stamped, band=(2, 40))
    late = dataclasses.replace(PLANT, input_delay=1e-3)
    with pytest.raises(ValueError, match="input_delay: samples at times of their own"):
        fq.fit(late, stamped)


def test_lines_know_no_state_of_rest():
    with pytest.raises(ValueError, match="initial_state='zero' has no errors at lines"):
        line_errors(PLANT, RECORD, initial_state="zero")


def test_an_offset_beside_a_parameter_of_its_name():
    u_time = 5e-3 * np.arange(len(RECORD.u))
    apart = fq.Record.from_logs(u_time, RECORD.u, u_time + 0.1, RECORD.y, offset="estimate")
    taken = dataclasses.replace(
        PLANT, parameters=[*PLANT.parameters, fq.Parameter("clock_offset", 1.0)],
        matrices=lambda a, b, clock_offset: PLANT.matrices(a=a, b=b * clock_offset),
    )  # fmt: skip
    with pytest.raises(ValueError, match="parameter 'clock_offset' is taken"):
        fq.fit(taken, apart)
    late = dataclasses.replace(
        PLANT, parameters=[*PLANT.parameters, fq.Parameter("Td", 1e-3)], input_delay="Td"
    )
    est = fq.fit(late, apart)
    assert any("the offset of the clocks is part of the delay Td" in n for n in est.notes)


def test_noise_of_a_response_that_tells_none():
    frf = dataclasses.replace(fq.h1([RECORD, RECORD.with_noise(0.01, seed=2)]), variance=None)
    with pytest.raises(ValueError, match=r"needs frf\.variance, .* \(1 - coherence\)"):
        fq.fit(PLANT, frf, weights="noise")
    with pytest.raises(ValueError, match=r"this response has none$"):
        fq.fit(PLANT, dataclasses.replace(frf, coherence=None), weights="noise")


def test_periodic_responses_know_their_channels_by_place():
    u = fq.multisine((1, 60), 1, 5e-3, 6, "random", n_inputs=2, orthogonal=True)
    plant = fq.GreyBox(
        lambda a, b: (np.diag([-a, -b]), np.eye(2), np.array([[1.0, 0.4], [0.2, 1.0]]), None),
        [fq.Parameter("a", 20.0), fq.Parameter("b", 40.0)],
        inputs=["p", "q"], outputs=["v", "w"],
    )  # fmt: skip
    runs = [
        fq.simulate(plant, one, 5e-3, hold="bl", input_names=["p", "q"]).with_noise(1e-3, seed=k)
        for k, one in enumerate(u)
    ]
    G = fq.periodic(runs, 1.0, skip=1)
    est = fq.fit(plant, G)
    assert est["a"] == pytest.approx(20, rel=0.01)
    turned = dataclasses.replace(
        plant, inputs=["q", "p"],
        matrices=lambda a, b: (
            np.diag([-a, -b]), np.eye(2)[:, ::-1], np.array([[1.0, 0.4], [0.2, 1.0]]), None,
        ),
    )  # fmt: skip
    # the same channels by name, in another order
    same = fq.fit(turned, G)
    np.testing.assert_allclose(same.values, est.values, rtol=1e-7)
    np.testing.assert_allclose(same.covariance_matrix, est.covariance_matrix, rtol=1e-5)
    few = dataclasses.replace(est, data=[dataclasses.replace(G, freedom=2)])
    with pytest.raises(ValueError, match=r"2 degrees of freedom .* measure more periods"):
        fq.cost_test(few)
    told = fq.cost_test(est)
    assert told["expected"] > 0
    assert 1e-4 < told["p_value"] <= 1


def test_an_estimate_tells_what_was_done_to_its_data(tmp_path):
    """Stamps that were put on a regular grid looked like a wrong hold, and nothing said so."""
    rng = np.random.default_rng(0)
    stamps = np.cumsum(0.01 * (1 + 0.2 * rng.random(500)))
    path = tmp_path / "log.csv"
    rows = np.column_stack([stamps, rng.standard_normal((500, 2))])
    np.savetxt(path, rows, delimiter=",", header="time,u,y", comments="")
    record = fq.read(path, resample=True)
    est = fq.fit(fq.first_order(), record)
    assert est.notes[-1] == f"data: {record.notes[-1]}"
    assert "jitter" in est.notes[-1]
    assert f"note: {est.notes[-1]}" in repr(est)
    many = [dataclasses.replace(record, notes=(f"note {i}", "shared")) for i in range(12)]
    told = fq.fit(fq.first_order(), many).notes
    assert told[-1] == "data: and 5 more (record.notes)"
    assert told.count("data: shared") == 1
