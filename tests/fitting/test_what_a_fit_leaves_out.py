"""What a fit leaves out: a black box where nothing is left, error bars until they are read."""

import copy
import pickle

import numpy as np
import pytest

import freqid as fq
from freqid.fitting import beside
from freqid.fitting.findings import Finding, Unread
from freqid.fitting.uncertainty import minimum

PLANT = fq.two_mass()
OFF = {p.name: 1.2 * p.value for p in PLANT.free_parameters}


def chirp(duration, noise=0.0):
    dt = 0.5e-3
    record = fq.simulate(PLANT, fq.chirp(10, 50, duration, dt), dt)
    return record.with_noise(noise * float(record.y.std()), seed=3)


@pytest.mark.parametrize("duration", [4, 20])  # as few lines as are searched on, and more
def test_exact_data_need_no_black_box(monkeypatch, duration):
    record = chirp(duration)

    def none(*_):
        raise AssertionError("a black box was fitted to data without noise")

    monkeypatch.setattr(beside.Reference, "of", none)
    est = fq.fit(PLANT, record, band=(10, 50), start=OFF)
    assert np.allclose(est.values, [PLANT[n] for n in est.names], rtol=1e-9)
    assert (est.n_starts, est.witness.verdict) == (1, "complete")


def test_the_first_descent_is_made_once(monkeypatch):
    record = chirp(4, noise=0.01)
    began = []
    own = fq.fitting.grey_search.straight_down

    def counted(objective, x):
        began.append(x.copy())
        return own(objective, x)

    for module in (fq.fitting.grey_search, fq.fitting.search.stages):
        monkeypatch.setattr(module, "straight_down", counted)
    est = fq.fit(PLANT, record, band=(10, 50), start=OFF)
    assert est.witness.verdict == "complete"
    assert len(began) == 1


def test_error_bars_are_computed_when_they_are_read(monkeypatch):
    asked = []
    own = minimum.score_covariance

    def counted(*given):
        asked.append(given)
        return own(*given)

    monkeypatch.setattr(minimum, "score_covariance", counted)
    est = fq.fit(PLANT, chirp(4, noise=0.01), band=(10, 50), start=OFF)
    assert not asked
    assert est.converged
    assert (est.parameters["std"] > 0).all()
    assert list(est.signs) == []
    assert len(asked) == 1


def test_warnings_of_the_fit_survive_copies_and_pickles():
    plant = PLANT.with_values(d=12.0).with_bounds(d=(11.0, 1e3))
    est = fq.fit(plant, chirp(4, noise=1e-4), band=(10, 50))
    (found,) = est.signs
    assert found.kind == "edge of a bound"
    for other in (copy.copy(est), copy.deepcopy(est), pickle.loads(pickle.dumps(est))):
        (again,) = other.signs
        assert (again, again.kind, again.number) == (found, found.kind, found.number)


def test_findings_are_read_once():
    calls = []

    def read():
        calls.append(1)
        return [Finding("not converged", "it did not"), Finding("units", "they differ")]

    found = Unread(read)
    assert not calls
    assert len(found) == 2
    assert [f.kind for f in found] == ["not converged", "units"]
    assert found[1:] == [found[1]]
    assert calls == [1]
    assert pickle.loads(pickle.dumps(found)) == list(found)


def test_starts_that_are_asked_for_are_made_without_noise_too():
    assert fq.fit(PLANT, chirp(4), band=(10, 50), start=OFF, n_starts=3).n_starts == 3


def test_an_exact_answer_out_of_sight_gives_way(monkeypatch):
    """With both residues free a mode above the Nyquist frequency explains each sample as well."""
    dt, w = 0.025, 2 * np.pi * 5
    plant = fq.GreyBox(
        lambda w, a, b: ([[-1.0, w], [-w, -1.0]], [[a], [b]], [[1, 0]], None),
        [fq.Parameter("w", w), fq.Parameter("a", 1.0), fq.Parameter("b", 2.0)],
    )
    record = fq.simulate(plant, fq.white_noise(400, seed=1), dt)
    own = fq.fitting.grey_search.straight_down
    alias = 2 * np.pi / dt + w

    def astray(objective, x):
        # on its way from the start to the mirror image
        there = x.copy()
        there[0] *= alias / (1.1 * w)
        return fq.fitting.search.descent.polish(objective, there)

    monkeypatch.setattr(fq.fitting.grey_search, "straight_down", astray)
    est = fq.fit(plant, record, start={"w": 1.1 * w})
    monkeypatch.setattr(fq.fitting.grey_search, "straight_down", own)
    assert est["w"] == pytest.approx(w, rel=1e-6)
