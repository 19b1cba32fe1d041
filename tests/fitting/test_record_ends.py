"""What a record's ends leak into an empirical response, and what a fit to it says of that."""

import pickle

import numpy as np
import pytest

import freqid as fq

DT, N = 2e-3, 4000
INPUTS = {
    "chirp": lambda rng: fq.chirp(1, 60, N * DT, DT)[:N],
    "white": lambda rng: rng.standard_normal(N),
    "steps": lambda rng: np.repeat(rng.uniform(-1, 1, N // 200), 200),
    "multisine": lambda rng: np.tile(fq.multisine((1, 60), 2.0, DT), 4),
}


def _mode(k, w, z):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[k, 0]], [[0.0]]


MODE = fq.GreyBox(_mode, [fq.Parameter(n, v) for n, v in {"k": 1.0, "w": 60.0, "z": 0.02}.items()])


def _response(name, seed, rest, level=0.03, band=(2, 50)):
    rng = np.random.default_rng(seed)
    u = np.concatenate([INPUTS[name](rng), np.zeros(rest)])
    record = fq.simulate(MODE, u, DT)
    return fq.etfe(record.with_noise(level * record.y.std(), seed=seed), band)


def _said(est):
    return next((w for w in est.warnings if w.kind == "leakage"), None)


@pytest.mark.parametrize("name", ["white", "steps", "multisine"])
@pytest.mark.parametrize("seed", range(3))
def test_motion_at_the_end_is_named_with_what_it_does(name, seed):
    est = fq.fit(MODE, _response(name, seed, 0))
    said = _said(est)
    assert said is not None
    assert [w.kind for w in est.warnings] == ["leakage"]
    # what the test promises is about what it does
    off = np.abs(est.values - [p.value for p in MODE.parameters])
    shift = np.max(off / np.sqrt(np.diag(est.covariance_matrix)))
    assert said.number == pytest.approx(shift, abs=1.5)
    assert (said.severity == "serious") == (said.number > 1)


@pytest.mark.parametrize("name", INPUTS)
def test_at_rest_at_both_ends_nothing_leaks(name):
    said = [_said(fq.fit(MODE, _response(name, seed, 8000))) for seed in range(5)]
    assert said == [None] * 5


def test_many_records_are_asked_in_groups():
    est = fq.fit(MODE, [_response("white", seed, 0) for seed in range(12)])
    said = _said(est)
    assert said is not None
    off = np.abs(est.values - [p.value for p in MODE.parameters])
    assert said.number > 0.5 * np.max(off / np.sqrt(np.diag(est.covariance_matrix)))
    rest = [_response("white", seed, 8000) for seed in range(12)]
    assert _said(fq.fit(MODE, rest)) is None


def test_without_noise_it_is_the_whole_of_what_is_left():
    est = fq.fit(MODE, _response("white", 0, 0, level=0.0))
    test = _said(est)
    assert test is not None
    assert test.p_value < 1e-100


def test_the_phase_of_the_input_goes_with_the_response(tmp_path):
    whole = _response("steps", 0, 0, band=None)
    whole.to_frame().to_csv(tmp_path / "frf.csv", index=False)
    made = [
        whole.select((2, 50)),
        fq.FrequencyResponse.from_frame(whole.to_frame()).select((2, 50)),
        fq.read_response(tmp_path / "frf.csv").select((2, 50)),
        fq.read_response(tmp_path / "frf.csv", input=0, output=0).select((2, 50)),
        pickle.loads(pickle.dumps(whole)).select((2, 50)),
    ]
    wanted = fq.fit(MODE, made[0])
    assert _said(wanted) is not None
    for other in made[1:]:
        assert np.allclose(other.input_phase, made[0].input_phase, atol=1e-9)
        assert _said(fq.fit(MODE, other)).number == pytest.approx(_said(wanted).number, rel=1e-6)
    assert np.allclose(whole.with_conditions(q=0.3).input_phase, whole.input_phase)
    in_band = fq.fit(MODE, whole, band=(2, 50))
    assert _said(in_band).number == pytest.approx(_said(wanted).number, rel=1e-6)


def test_the_phase_is_one_number_a_line():
    frf = _response("white", 0, 0)
    with pytest.raises(ValueError, match="input_phase"):
        type(frf)([1.0, 2.0], [1j, 2j], input_phase=[0.0])


def test_what_leaks_hides_no_fault():
    # what is left of the motion after 1.2 s leaks a little; an output that comes early is named too
    rng = np.random.default_rng(1)
    u = np.concatenate([INPUTS["white"](rng), np.zeros(600)])
    record = fq.simulate(MODE, u, DT)
    early = fq.Record(record.u[:-1], record.y[1:], DT).with_noise(0.01 * record.y.std(), seed=1)
    found = fq.fit(MODE, fq.etfe(early, (2, 50))).warnings
    assert "hold rejected" in [w.kind for w in found]
    assert [w.severity for w in found if w.kind == "leakage"] == ["minor"]
