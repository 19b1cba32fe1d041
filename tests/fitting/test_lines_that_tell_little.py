"""Lines of a response that its own variances say tell next to nothing, and count for most."""

import pytest

import freqid as fq

DT = 1e-3


def axis(J, b, k):
    return [[0, 1], [-k / J, -b / J]], [[0], [1 / J]], [[1, 0]], None


AXIS = fq.GreyBox(axis, [fq.Parameter(n, v) for n, v in {"J": 2.5e-3, "b": 0.02, "k": 7.0}.items()])


@pytest.fixture(scope="module")
def record():
    swept = fq.simulate(AXIS, fq.chirp(1, 40, 4, DT), DT)
    return swept.with_noise(2e-3, seed=1)


def test_a_response_whose_ends_tell_nothing_says_so(record):
    """Where a sweep ends its last lines had made stiffnesses of up to 1e9, and "no signal"."""
    frf = fq.local_rational(record, band=(1, 40))
    (note,) = [n for n in fq.fit(AXIS, frf).notes if "decide in this fit" in n]
    assert "weights='noise'" in note
    weighted = fq.fit(AXIS, frf, weights="noise")
    assert not any("decide in this fit" in n for n in weighted.notes)
    assert weighted["k"] == pytest.approx(7.0, rel=0.01)
    # within the band that the sweep drives well there is nothing to be said
    assert not any("decide" in n for n in fq.fit(AXIS, frf, band=(8, 30)).notes)
    # lines that the input does not drive count by its power, which is next to nothing
    once = fq.simulate(AXIS, fq.multisine((1, 10), 4.0, DT, seed=2), DT).with_noise(1e-3, seed=3)
    everywhere = fq.fit(AXIS, fq.local_rational(once, band=(1, 100)))
    assert not any("decide" in n for n in everywhere.notes)


def test_a_record_beside_a_response_counts_in_other_units(record):
    averaged = fq.h1(record, 1000, band=(1, 40))
    (note,) = [n for n in fq.fit(AXIS, [record, averaged]).notes if "in their own units" in n]
    assert "weights='noise'" in note
    both = fq.fit(AXIS, [record, averaged], weights="noise")
    assert not any("in their own units" in n for n in both.notes)
