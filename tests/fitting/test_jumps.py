"""Rows that were lost in all channels, and knocks: the motion jumps, and the verdict says where."""

import re

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT = 2e-3


def axis(Jm, Ja, k, d, f):
    """A motor that drives a load through a shaft, seen by the motor's speed."""
    A = [[0, 1, -1], [-k / Jm, -(f + d) / Jm, d / Jm], [k / Ja, d / Ja, -(f + d) / Ja]]
    return A, [[0], [1 / Jm], [0]], [[0, 1, 0]], None


VALUES = {"Jm": 1e-3, "Ja": 3e-3, "k": 8.0, "d": 0.01, "f": 4e-3}
AXIS = fq.GreyBox(axis, [fq.Parameter(n, v) for n, v in VALUES.items()])
MODE = fq.GreyBox(
    lambda w, z, g: ([[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[g, 0]], None),
    [fq.Parameter("w", 40.0), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0)],
)
INPUTS = {
    "noise": lambda seed: np.random.default_rng(seed).standard_normal(4000),
    "chirp": lambda seed: fq.chirp(0.5, 40, 8, DT),
}


def measured(plant, kind, seed, kicks=(), pole=0.0, level=0.02):
    """A record simulated in scipy, with noise; ``kicks`` are added to the state at some samples."""
    A, B, C, _ = plant.state_space()
    sampled = scipy.signal.cont2discrete((A, B, C, np.zeros((1, 1))), DT)
    u, x, y = INPUTS[kind](seed), np.zeros(len(A)), []
    for k, value in enumerate(u):
        x = x + dict(kicks).get(k, 0.0)
        y.append(float((C @ x)[0]))
        x = sampled[0] @ x + sampled[1][:, 0] * value
    e = np.random.default_rng([seed, 1]).standard_normal(len(u) + 300)
    v = scipy.signal.lfilter([np.sqrt(1 - pole**2)], [1, -pole], e)[300:]
    return u, np.array(y) + level * np.std(y) * v


def lost(plant, kind, seed, rows):
    """A record whose logger has left out rows of both channels, the time closed up."""
    u, y = measured(plant, kind, seed)
    return fq.Record(np.delete(u, rows), np.delete(y, rows), DT)


def jumps(est):
    """When the motion is said to jump, in s."""
    text = next(str(w) for w in est.warnings if w.kind == "jump")
    return [float(t) for t in re.findall(r"([\d.e-]+) s(?:,| and|\b)", text.split(", as where")[0])]


@pytest.mark.study
@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("plant", [AXIS, MODE], ids=["axis", "mode"])
def test_rows_that_were_lost_are_named_with_their_place(plant, kind):
    """They had been trusted 6 and 9 standard errors off, or were "another mode", "nonlinear"."""
    named = 0
    for seed in range(3):
        rows = np.sort(np.random.default_rng([seed, 2]).choice(np.arange(400, 3600), 5, False))
        est = fq.fit(plant, lost(plant, kind, seed, rows))
        truth = np.array([plant[n] for n in est.names])
        z = (est.values - truth) / est.parameters["std"].to_numpy()
        assert not est.verdict.trusted or np.abs(z).max() < 3
        if est.warnings[0].kind != "jump":
            # to a sweep they are a change midway, or a plant that bends, as well
            continue
        named += 1
        places = (rows - np.arange(len(rows))) * DT
        for said in jumps(est):
            # where the motion is small for a while its place is not told to the sample
            assert np.abs(places - said).min() <= 10 * DT


def test_a_knock_is_named_and_cutting_it_out_is_the_cure():
    knock = (1500, np.array([0.0, 0.6, 0.0]))
    u, y = measured(AXIS, "noise", 4, [knock])
    est = fq.fit(AXIS, fq.Record(u, y, DT))
    assert est.warnings[0].kind == "jump"
    assert jumps(est) == pytest.approx([1500 * DT], abs=DT)
    whole = fq.Record(u, y, DT)
    parts = [whole.slice(0, 1500 * DT), whole.slice(1500 * DT, 4000 * DT)]
    assert fq.fit(AXIS, parts).verdict.trusted


def test_of_several_experiments_it_is_said_which():
    quiet, _ = (fq.Record(*measured(MODE, "noise", s), DT) for s in (7, 8))
    u, y = measured(MODE, "noise", 8, [(2000, np.array([0.2, 0.0]))])
    est = fq.fit(MODE, [quiet, fq.Record(u, y, DT)])
    assert "jumps at 4 s of experiment 1" in str(est.warnings[0])


@pytest.mark.study
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_records_without_a_jump_have_none(pole):
    found = []
    for seed in range(20):
        for kind in INPUTS:
            u, y = measured(MODE, kind, seed, pole=pole, level=0.05)
            est = fq.fit(MODE, fq.Record(u, y, DT))
            assert "jump" not in [w.kind for w in est.warnings]
            if "jump" in est.suspects.index:
                found.append(est.suspects.loc["jump", "p_value"])
    # the p of the largest of several thousand is an upper limit
    assert np.mean(np.array(found) < 0.05) <= 0.1


def test_samples_that_are_off_are_no_jumps():
    """Into and out of a spike a speed jumps twice: spikes were called lost rows."""
    for kind in INPUTS:
        u, y = measured(AXIS, kind, 1)
        y[[900, 1700, 2600]] += 2 * y.std()
        est = fq.fit(AXIS, fq.Record(u, y, DT))
        assert est.warnings[0].kind == "spikes"
        assert "jump" not in [w.kind for w in est.warnings]


def test_a_jump_at_an_end_of_a_decimated_record_is_what_was_folded():
    axis = fq.two_mass()
    fast = fq.simulate(axis, fq.chirp(10, 80, 10, 5e-4), 5e-4)
    est = fq.fit(axis, fast.decimate(10))
    (said,) = [w for w in est.warnings if w.kind == "jump"]
    assert "at 0.01 s, an end of a decimated record: decimate(n, keep_input=True)" in said
    assert "rows are lost in all channels" not in said
    kept = fq.fit(axis, fast.decimate(10, keep_input=True))
    assert "jump" not in {w.kind for w in kept.warnings}
