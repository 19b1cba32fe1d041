"""The search aims at a black box, never ends above its start, and has a witness."""

import json

import numpy as np
import pytest
import scipy.stats
from scipy.signal import lfilter

import freqid as fq
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.reading import Reading


def light_mode():
    """ω = 40 rad/s, ζ = 0.05, gain 1."""
    return fq.GreyBox(
        lambda w, z, g: ([[0, 1], [-(w**2), -2 * z * w]], [[0], [g * w**2]], [[1, 0]], None),
        [fq.Parameter("w", 40.0), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0)],
    )


def stiff():
    """b/(s² + cs + k)."""
    return fq.GreyBox(
        lambda b, c, k: ([[0, 1], [-k, -c]], [[0], [b]], [[1, 0]], None),
        [fq.Parameter("b", 1600.0), fq.Parameter("c", 4.0), fq.Parameter("k", 1600.0)],
    )


def worst(est, model):
    return max(abs(est[n] / model[n] - 1) for n in est.names)


@pytest.mark.parametrize("weights", [None, "noise"])
def test_rough_inputs_of_several_lengths_are_not_lost(weights):
    model = light_mode()
    for seed in range(10):
        rng = np.random.default_rng(seed)
        records = [
            fq.simulate(model, rng.standard_normal(N), 0.01).with_noise(std, seed=9 * seed + i)
            for i, (N, std) in enumerate(((200, 0.1), (500, 1.0), (900, 0.3)))
        ]
        assert worst(fq.fit(model, records, weights=weights), model) < 0.2


@pytest.mark.study
@pytest.mark.parametrize("part", [(5, 10), (3, 8)])
@pytest.mark.parametrize("weights", [None, "noise"])
def test_no_fit_ends_above_the_cost_of_its_start(plant, fast, part, weights):
    for seed in range(4):
        record = fast.slice(*part).with_noise(0.5, seed=seed)
        est = fq.fit(plant, record, weights=weights)
        if weights is None:
            own = fq.compare(plant, record).residuals
            assert est.cost <= own @ own * (1 + 1e-9)
        assert est["k"] == pytest.approx(plant["k"], rel=0.1)


@pytest.mark.parametrize(("noise", "limit"), [(0.8, 0.5), (2.5, 1.0)])
def test_strong_noise_loses_nothing_silently(noise, limit):
    model = stiff()
    for seed in range(12):
        record = fq.simulate(model, fq.white_noise(500, seed=seed), 0.01)
        record = record.with_noise(noise * record.y.std(), seed=seed + 1)
        est = fq.fit(model, record)
        # a chance of the noise, which the error bars tell, is not a minimum lost
        off = max(abs(est[n] - model[n]) / est.parameters["std"][n] for n in est.names)
        assert worst(est, model) < limit or off < 4 or est.warnings


def test_coloured_noise_and_noise_weights():
    model = stiff()
    for seed in range(10):
        rng = np.random.default_rng(seed)
        record = fq.simulate(model, rng.standard_normal(500), 0.01)
        noise = lfilter([1], [1, -0.9], rng.standard_normal(700))[200:]
        y = record.y + 0.3 * record.y.std() * noise / noise.std()
        est = fq.fit(model, fq.Record(record.u, y, 0.01), weights="noise")
        assert worst(est, model) < 0.5


@pytest.mark.parametrize("state", [[50.0, 0.0], [0.0, 3000.0], [20.0, -900.0]])
def test_a_large_initial_state_is_no_trouble(state):
    u = 0.1 * fq.white_noise(400, seed=1)
    record = fq.simulate(stiff(), u, 0.01, initial_state=state)
    est = fq.fit(stiff(), record, n_starts=1)
    assert worst(est, stiff()) < 1e-6


@pytest.mark.study
@pytest.mark.parametrize("seed", range(2))
def test_three_masses_from_a_factor_three(seed):
    model = fq.drivetrain(3)
    record = fq.simulate(model, fq.chirp(0.5, 80, 20, 2e-3), 2e-3).with_noise(0.5, seed=5)
    rng = np.random.default_rng(seed)
    start = {p.name: p.value * 3 ** rng.uniform(-1, 1) for p in model.free_parameters}
    est = fq.fit(model, record, start=start)
    black = fq.fit(fq.OutputError(len(model.poles)), record)
    assert est.cost < 1.002 * black.cost


@pytest.mark.study
@pytest.mark.parametrize("seed", [8, 17, 32])
def test_a_mode_that_few_lines_do_not_tell_is_told_by_more(seed):
    """Three masses in noise: on the first six hundred lines a mode of noise explained as much."""
    model = fq.drivetrain(3)
    rng = np.random.default_rng(seed)
    record = fq.simulate(model, fq.chirp(0.5, 80, 20, 2e-3), 2e-3)
    record = record.with_noise((0.3, 0.5, 1.0)[seed % 3], seed=seed)
    start = {p.name: p.value * 3 ** rng.uniform(-1, 1) for p in model.free_parameters}
    est = fq.fit(model, record, start=start)
    assert est.cost <= fq.fit(model, record).cost * (1 + 1e-6)
    assert est.witness.verdict == "complete"


def test_a_mode_is_not_its_mirror_image():
    model = light_mode()
    for seed in range(8):
        record = fq.simulate(model, fq.white_noise(600, seed=seed), 0.01).with_noise(0.1, seed=seed)
        est = fq.fit(model, record, start={"w": -35.0, "z": -0.1})
        assert est["w"] == pytest.approx(40, rel=0.02)
        assert est["z"] > 0
        assert not est.warnings


def test_a_function_may_fill_the_same_arrays_at_every_call():
    A, B, C = np.zeros((2, 2), complex), np.zeros((2, 1), complex), np.array([[1.0, 0]])

    def reused(b, c, k):
        A[0, 1], A[1, 0], A[1, 1], B[1, 0] = 1, -k, -c, b
        return (A, B, C, None) if np.iscomplexobj(b + c + k) else (A.real, B.real, C, None)

    model = fq.GreyBox(reused, stiff().parameters)
    record = fq.simulate(stiff(), fq.white_noise(500), 0.01)
    est = fq.fit(model, record, start={"b": 1300.0, "c": 5.0, "k": 1900.0})
    assert worst(est, stiff()) < 1e-6


def test_the_edge_of_where_a_model_can_be_computed_is_named():
    def broken(b, a):
        return [[-a if a < 90 else np.nan]], [[b]], [[1.0]], None

    parameters = [fq.Parameter("b", 80.0), fq.Parameter("a", 80.0)]
    record = fq.simulate(fq.first_order(), fq.white_noise(800), 1e-3).with_noise(0.001)
    est = fq.fit(fq.GreyBox(broken, parameters), record)
    assert not est.converged
    assert any("cannot be computed" in w for w in est.warnings)


@pytest.mark.parametrize("size", [1e200, 1e-300, 0.0])
def test_outputs_beyond_the_range_of_numbers_are_named(size):
    record = fq.simulate(fq.first_order(), fq.white_noise(300), 1e-3)
    scaled = fq.Record(record.u, size * record.y, record.dt)
    for model in (fq.first_order(), fq.OutputError(1), fq.TransferFunction(0, 1)):
        with pytest.raises(ValueError, match="outputs are"):
            fq.fit(model, scaled)


@pytest.mark.parametrize("size", [1e100, 1e-100])
def test_outputs_of_any_other_size_are_fitted_alike(size):
    record = fq.simulate(fq.first_order(), fq.white_noise(300), 1e-3).with_noise(0.01)
    scaled = fq.Record(record.u, size * record.y, record.dt)
    est, plain = fq.fit(fq.first_order(b=100 * size), scaled), fq.fit(fq.first_order(), record)
    assert est["b"] / size == pytest.approx(plain["b"], rel=1e-6)
    assert est["a"] == pytest.approx(plain["a"], rel=1e-6)


# the witness -------------------------------------------------------------------------------------


@pytest.mark.study
@pytest.mark.parametrize("coloured", [False, True])
def test_the_witness_is_uniform_where_the_model_is_right(coloured):
    model, p = light_mode(), []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        record = fq.simulate(model, rng.standard_normal(900), 0.01)
        noise = rng.standard_normal(1100)
        noise = lfilter([1], [1, -0.9], noise) if coloured else noise
        y = record.y + 0.3 * noise[200:] / noise.std()
        witness = fq.fit(model, fq.Record(record.u, y, 0.01)).witness
        assert witness.verdict == ("lacking" if witness.p_value < 0.01 else "complete")
        p.append(witness.p_value)
    assert scipy.stats.kstest(p, "uniform").pvalue > 0.01


@pytest.mark.study
@pytest.mark.parametrize(
    ("hold", "verdict"), [(None, "complete"), ("zoh", "lacking"), ("foh", "lacking")]
)
def test_the_witness_refuses_the_wrong_hold(plant, slow, hold, verdict):
    record = slow.with_noise(0.05, seed=1)
    est = fq.fit(plant, record, hold=hold, band=(10, 80))
    assert est.witness.verdict == verdict
    assert est.witness.cost <= est.cost * (1 + 1e-9)
    assert f"F = {est.witness.f:.3g}" in est.witness.sentence
    assert verdict in repr(est)
    assert json.loads(json.dumps(est.to_dict()["witness"]))["verdict"] == verdict


@pytest.mark.study
def test_the_witness_refuses_a_structure_that_is_too_stiff(plant, fast):
    record = fast.with_noise(0.05, seed=1)
    wrong = fq.fit(plant.with_values(d=30).fix("d"), record, band=(10, 80))
    assert wrong.witness.verdict == "lacking"
    assert wrong.verdict.grade != "trust"
    assert "another mode" in [w.kind for w in wrong.warnings], wrong.warnings
    right = fq.fit(plant.fix("d"), record, band=(10, 80))
    assert right.witness.verdict == "complete"
    assert right.witness.degrees[0] == wrong.witness.degrees[0] == 2


@pytest.mark.study
def test_the_witness_of_an_output_slower_than_its_input(plant, fast):
    for factor in (10, 40):
        record = fast.with_noise(0.05, seed=1).decimate(factor, keep_input=True)
        witness = fq.fit(plant, record, band=(10, 80)).witness
        assert witness.verdict == "complete"
        assert witness.cost < 5


@pytest.mark.parametrize("weights", [None, "noise"])
def test_a_short_noisy_record_has_its_witness_too(weights):
    """The gap of the costs is large in few data: the search behind the estimate counts."""
    verdicts = []
    for seed in range(10):
        record = fq.simulate(light_mode(), fq.white_noise(400, seed=seed), 0.01)
        est = fq.fit(light_mode(), record.with_noise(0.5, seed=seed), weights=weights)
        assert 1 <= est.n_agreed <= est.n_starts
        verdicts.append(est.witness.verdict)
    assert verdicts.count("complete") >= 8


def test_where_there_is_no_witness_it_says_why(plant, slow):
    assert "hold is unknown" in fq.fit(plant, slow, hold="estimate", band=(10, 80)).witness.sentence
    assert fq.fit(fq.OutputError(3), slow).witness.verdict == "absent"
    band_limited = fq.fit(plant, slow, hold="bl", band=(10, 80)).witness
    assert "without a hold" in band_limited.sentence


def test_noise_free_data_are_complete(plant, fast):
    witness = fq.fit(plant, fast, band=(10, 80)).witness
    assert witness.verdict == "complete"
    assert witness.p_value == 1


def test_a_black_box_beside_a_model_leaves_no_more_than_it(plant, fast):
    for reading in (
        Reading.of(fast.with_noise(0.1, seed=1), band=(10, 80)),
        Reading.of(fast.decimate(10).with_noise(0.1, seed=1), "foh", (10, 80)),
        Reading.of(fast.decimate(20, keep_input=True).with_noise(0.1, seed=1), band=(10, 80)),
    ):
        own = fq.fit(plant, reading.data, hold=reading.hold, band=(10, 80))
        beside = Reference.of(plant, [reading]).beside(own.model, [reading])
        assert beside.cost <= own.cost * (1 + 1e-9)


def test_a_prior_has_no_part_in_the_witness(plant, fast):
    record = fast.with_noise(0.05, seed=1)
    sure = plant.with_prior(Ja=(12.0, 1e-3))
    est = fq.fit(sure, record, band=(10, 80))
    assert est["Ja"] > 11.5
    assert est.witness.verdict == "complete"


def test_a_witness_beside_responses_of_the_plant_itself(plant):
    """Two responses over unlike bands, as an analyser gives them: no hold, no sample time."""
    rng = np.random.default_rng(5)

    def response(low, high, true):
        f = np.linspace(low, high, 150)
        G = true.frequency_response(2 * np.pi * f).response
        noise = 0.01 * rng.standard_normal((2, *G.shape))
        variance = 2e-4 * np.abs(G) ** 2
        return fq.FrequencyResponse(f, G * (1 + noise[0] + 1j * noise[1]), variance=variance)

    start = plant.with_values(k=1.6e5, Jm=6e-3)
    right = fq.fit(start, [response(5, 60, plant), response(20, 90, plant)], weights="noise")
    assert right.witness.verdict == "complete"
    assert right.n_starts == 1
    assert right["k"] == pytest.approx(plant["k"], rel=0.02)
    # one mode more than the model has
    chain = fq.drivetrain(3)
    wrong = fq.fit(start, response(1, 100, chain), weights="noise")
    assert wrong.verdict.grade != "trust"
    assert "another mode" in [w.kind for w in wrong.warnings], wrong.warnings


@pytest.mark.study
@pytest.mark.parametrize("w", [24.0, 29.5, 41.0])
def test_walks_that_agree_on_a_lobe_are_not_believed(w):
    """All of a dozen starts ended in one lobe of a narrow resonance, at twice the least cost."""
    plant = fq.GreyBox(
        lambda w, z: ([[0, w], [-w, -2 * z * w]], [[0], [w]], [[1, 0]], None),
        [fq.Parameter("w", w), fq.Parameter("z", 0.0018, fixed=True)],
    )
    t = 0.01 * np.arange(300)
    u = sum(np.sin(2 * np.pi * f * t + f) for f in (0.7, 2.1, 4.4, 9.3))
    for seed in range(4):
        clean = fq.simulate(plant, u, 0.01)
        record = clean.with_noise(float(clean.y.std()), seed=seed)
        truth = fq.fit(plant, record)
        for factor in (0.45, 0.6, 1.7, 2.5):
            est = fq.fit(plant, record, start={"w": factor * w})
            assert est.cost <= truth.cost * (1 + 1e-6)
