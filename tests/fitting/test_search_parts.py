"""Parts of the search beside what they are said to be: scattered starts, what an end leaves."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import freqid as fq
from freqid.fitting import grey_search
from freqid.fitting.search.interrupted import INTERRUPTED, best_so_far
from freqid.fitting.search.scatter import around, promising
from freqid.fitting.search.stopping import Bound, Found, StopRule


def structure(start, reach=3.0, lower=-1e9, upper=1e9):
    """Unknowns within bounds, whose span is a factor about the start, or as far on both sides."""
    start = np.asarray(start, float)
    return SimpleNamespace(
        lower=np.full(len(start), lower),
        upper=np.full(len(start), upper),
        span=lambda x: (
            np.where(x != 0, np.minimum(x / reach, x * reach), -reach),
            np.where(x != 0, np.maximum(x / reach, x * reach), reach),
        ),
    )


def test_half_of_the_starts_lie_half_way_on_a_logarithm():
    start = np.array([2.0, -50.0])
    points = around(structure(start), start, 64, seed=1)
    far = np.abs(np.log(points / start))
    # of a span of ln 3 on both sides the near half takes the inner half, the others all of it
    assert far[:32].max() <= np.log(3) / 2 * (1 + 1e-12)
    assert far[:32].max() > 0.9 * np.log(3) / 2
    assert far[32:].max() > 0.9 * np.log(3)
    assert abs(np.log(points / start)[32:].mean(axis=0)).max() < 0.1


def test_where_signs_differ_half_way_is_the_mean():
    start = np.zeros(1)
    points = around(structure(start), start, 64, seed=2)[:, 0]
    assert np.abs(points[:32]).max() <= 1.5
    assert np.abs(points[32:]).max() > 2.7
    assert (points < 0).any()
    assert (points > 0).any()


def test_scattered_starts_keep_within_bounds():
    start = np.array([2.0, 3.0])
    points = around(structure(start, lower=1.5, upper=4.0), start, 50, seed=3)
    assert ((points >= 1.5) & (points <= 4.0)).all()


def test_the_most_promising_come_first_and_what_has_no_cost_last():
    def point(x):
        return None if x[0] > 4 else SimpleNamespace(cost=(x[0] - 3) ** 2)

    start = np.array([2.0])
    cost = SimpleNamespace(structure=structure(start), point=point)
    first = promising(cost, start, 5, seed=0)[:, 0]
    assert (np.diff((first - 3) ** 2) >= 0).all()
    assert abs(first[0] - 3) < 0.1
    assert (promising(cost, start, 64, seed=0)[-1] > 4).all()


def test_an_interrupted_search_tells_the_first_cost_at_the_best_point():
    def cost(least, off):
        return SimpleNamespace(least=least, point=lambda x: (off, float(x[0])))

    start = np.array([1.0])
    known = cost((np.array([7.0]), 0.1), "fit"), cost((np.array([9.0]), 0.2), "few lines")
    for objectives, point in (
        (known, ("fit", 7.0)),
        ((cost(None, "fit"), known[1]), ("fit", 9.0)),
        ((cost(None, "fit"), cost(None, "few lines")), ("fit", 1.0)),
    ):
        found = best_so_far(objectives, start)
        assert found.point == point
        assert found.x == pytest.approx(point[1])
        assert (found.converged, found.message) == (False, INTERRUPTED)
    lost = SimpleNamespace(least=None, point=lambda x: None)
    assert best_so_far([lost], start) is None


def noisy_axis():
    """The paper's plant, a record of it whose friction shows on all lines, and a start."""
    plant = fq.two_mass()
    record = fq.simulate(plant, fq.chirp(10, 80, 10, 5e-4), 5e-4)
    start = {p.name: 1.2 * p.value for p in plant.free_parameters}
    return plant, record.with_noise(0.05 * record.y.std(), seed=1), start


def test_starts_on_few_lines_are_counted_once(monkeypatch):
    plant, record, start = noisy_axis()
    searched = grey_search._searched

    def after_many(*given, **more):
        found, beside = searched(*given, **more)
        return dataclasses.replace(found, n_starts=13, n_agreed=9, sure=False), beside

    monkeypatch.setattr(grey_search, "_searched", after_many)
    est = fq.fit(plant, record, start=start)
    assert (est.n_starts, est.n_agreed) == (13, 9)


def test_a_minimum_that_few_lines_leave_open_is_followed_to_more(monkeypatch):
    """The friction shows on more of the lines: no black box is looked for anew there."""
    plant, record, start = noisy_axis()
    asked = []
    looked_for = grey_search.beside_of
    monkeypatch.setattr(
        grey_search, "beside_of", lambda *given: asked.append(given[2]) or looked_for(*given)
    )
    est = fq.fit(plant, record, start=start)
    assert len(asked) == 1
    assert est.n_starts == 1
    assert est.witness.verdict == "complete"
    # the minimum is that of all lines
    many = fq.fit(plant, record, start=start, n_starts=8)
    assert est.cost == pytest.approx(many.cost, rel=1e-10)


@pytest.mark.parametrize(
    ("converged", "told", "starts", "enough"),
    [(False, False, 49, True), (False, False, 37, False), (True, False, 49, False),
     (False, True, 49, False)],
)  # fmt: skip
def test_a_valley_without_an_end_does_not_take_all_starts(converged, told, starts, enough):
    """A missing delay in noise rounds: each round had gone on in the same valley for 70 s."""
    triangle = np.diag([1.0, 1.0 if told else 1e-9, 10.0])
    end = SimpleNamespace(
        cost=100.0, converged=converged, x=np.ones(2) * 100.0,
        point=SimpleNamespace(triangle=triangle, cost=100.0),
    )  # fmt: skip
    rule = StopRule(None, 0.0, lambda: 1.0, Bound(1.0, 3, 1000))
    assert rule.enough(Found(end, n_starts=starts, n_agreed=1)) is enough
