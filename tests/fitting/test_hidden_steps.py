"""A dead time, a step, a constant and a free initial state: a long delay hides the step.

The outputs that it leaves open cost nothing, and what comes to rest after them an initial state
explains as well as any plant.
"""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

K, TAU, TD, DT, FINE = 2.5, 300.0, 35.0, 10.0, 20


def heated(K, tau):
    return [[-1 / tau]], [[K / tau]], [[1.0]], None


PLANT = fq.GreyBox(
    heated,
    [
        fq.Parameter("K", 1.0, "K/%"),
        fq.Parameter("tau", 100.0, "s", lower=1),
        fq.Parameter("Td", 0.0, "s", lower=0),
    ],
    input_delay="Td",
)


def logged(u, seed, noise, past=0.0, delay=TD):
    """K/(τ s + 1) behind the delay, from rest at the first input, 20 degrees added."""
    h = DT / FINE
    late, pole = round(delay / h), np.exp(-h / TAU)
    fine = np.r_[np.full(late, u[0]), np.repeat(u, FINE)][: len(u) * FINE]
    y, _ = scipy.signal.lfilter([0, 1 - pole], [1, -pole], K * fine, zi=[K * u[0]])
    e = np.random.default_rng(seed).standard_normal(len(u) + 200) * noise
    e = scipy.signal.lfilter([np.sqrt(1 - past**2)], [1, -past], e)[200:]
    return fq.Record(u, 20 + y[::FINE] + e, DT)


STEP = np.r_[np.full(20, 30.0), np.full(220, 50.0)]


@pytest.mark.parametrize("seed", [16, *range(3)])
def test_a_grey_box_keeps_the_step(seed):
    """Of 80 the first ended at 263 s, of other noise three of 40: "swapped channels"."""
    est = fq.fit(PLANT, logged(STEP, seed, 0.2, past=0.9), offset="estimate")
    assert est["Td"] == pytest.approx(TD, abs=6)
    assert est["K"] == pytest.approx(K, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_black_box_keeps_the_step(seed):
    """Six of six ended at 240 to 300 s."""
    spec = fq.TransferFunction(0, 1, delay="estimate")
    est = fq.fit(spec, logged(STEP, seed, 0.05), offset="estimate")
    assert est.parameters["value"]["delay"] == pytest.approx(TD, abs=1.5)
    assert est.verdict.trusted


@pytest.mark.parametrize("delay", [5.0, 205.0, 395.0])
@pytest.mark.parametrize("seed", range(2))
def test_a_long_delay_is_found_all_the_same(delay, seed):
    """What it leaves open of an input that goes on is little beside what it explains."""
    u = 40 + 10 * np.random.default_rng(100 + seed).choice([-1.0, 1.0], 90).repeat(4)
    data = logged(u, seed, 0.2, past=0.9, delay=delay)
    est = fq.fit(PLANT, data, offset="estimate")
    assert est["Td"] == pytest.approx(delay, abs=4)
    found = fq.fit(fq.TransferFunction(0, 1, delay="estimate"), data, offset="estimate")
    assert found.parameters["value"]["delay"] == pytest.approx(delay, abs=4)


def test_a_delay_beyond_what_a_record_tells_says_so():
    with pytest.raises(ValueError, match="an eighth of the outputs"):
        fq.fit(PLANT, logged(STEP, 0, 0.05, delay=400.0), offset="estimate")


def test_a_delay_that_outgrows_half_of_the_record_describes_nothing_of_it():
    """A second lag that the model lacks: fits to halves of the record wander there."""
    two = fq.GreyBox(
        lambda K, slow, fast: (
            [[-1 / slow, 0], [1 / fast, -1 / fast]], [[K / slow], [0]], [[0, 1.0]], None
        ),
        [fq.Parameter("K", K), fq.Parameter("slow", TAU), fq.Parameter("fast", 60.0)],
        input_delay=TD,
    )  # fmt: skip
    clean = fq.simulate(two, STEP - STEP[0], DT)
    record = fq.Record(STEP, 95 + clean.y, DT).with_noise(0.05, seed=2)
    est = fq.fit(PLANT, record, offset="estimate")
    assert est.warnings[0].kind == "another mode"
    assert est.verdict.grade == "doubt"
