"""Experiments at the same lines, evaluated as channels of one: a plant answers each line once.

Repeats of an experiment meet one plant at the same points. What they do not share are their data,
their weights, and the unknowns of their own initial states.
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Hashable, Iterator, Sequence
from typing import NamedTuple, TypeAlias, cast

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.evaluation import SpectralEvaluation, bared, projected
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.lines import Points
from freqid.lti import InputHolds, Realisation, eliminate

# lines of all channels that are evaluated as one: with more the arithmetic takes the time, and the
# memory
_TOGETHER = 4096

# a residual without its initial state, the rows that span that, and its unknowns
Left: TypeAlias = "tuple[FloatArray, FloatArray, FloatArray | None]"


class Eliminated(NamedTuple):
    """Experiment ``number`` at a trial point without its initial state: derivatives (P, rows) of
    the residual as it was; the residual (rows,) off the orthonormal rows Q (q, rows) that the
    initial state spans, and the unknowns of that, None where there are none.
    """

    number: int
    jacobian: FloatArray
    residual: FloatArray
    Q: FloatArray
    initial: FloatArray | None


class Lone:
    """An experiment that is like no other."""

    def __init__(self, number: int, experiment: Experiment) -> None:
        self.number, self.experiment = number, experiment

    def at(self, realisation: Realisation) -> Iterator[Eliminated]:
        """The experiment at a trial point."""
        evaluation = self.experiment.at(realisation)
        r, Q, initial = projected(evaluation)
        yield Eliminated(self.number, evaluation.jacobian(initial), r, Q, initial)


class Repeats:
    """Experiments at the same lines under one hold; those that meet the same plant go together."""

    def __init__(self, numbers: Sequence[int], members: Sequence[SpectralExperiment]) -> None:
        self.numbers, self.members = numbers, members
        self._stacks: dict[tuple[int, ...], _Stack] = {}

    def at(self, realisation: Realisation) -> Iterator[Eliminated]:
        """Each of the experiments at a trial point."""
        meeting: dict[int, tuple[Realisation, list[int]]] = {}
        for i, e in enumerate(self.members):
            met = realisation.for_place(e.place)
            meeting.setdefault(id(met), (met, []))[1].append(i)
        for met, some in meeting.values():
            # outputs that a delay leaves open are each experiment's own
            if len(some) == 1 or met.delay is not None:
                for i in some:
                    yield from Lone(self.numbers[i], self.members[i]).at(met)
            else:
                yield from self._stack(tuple(some)).at(met)

    def _stack(self, some: tuple[int, ...]) -> _Stack:
        if some not in self._stacks:
            numbers = [self.numbers[i] for i in some]
            self._stacks[some] = _Stack(numbers, [self.members[i] for i in some])
        return self._stacks[some]


class _Stack:
    """Experiments as the channels of one."""

    def __init__(self, numbers: Sequence[int], members: Sequence[SpectralExperiment]) -> None:
        self.numbers, self.members = numbers, members
        first = members[0]
        # with the same weights they have the same free motions
        self.alike = all(np.array_equal(e.lines.scale, first.lines.scale) for e in members)
        plain = members if self.alike else [_apart(e) for e in members]
        lines = dataclasses.replace(
            plain[0].lines,
            U=np.concatenate([e.lines.U for e in plain], axis=1),
            Y=np.concatenate([e.lines.Y for e in plain], axis=1),
            scale=np.concatenate([e.lines.scale for e in plain], axis=1),
        )
        self.one = dataclasses.replace(
            plain[0],
            lines=lines,
            points=Points(first.points.z, np.concatenate([e.points.U for e in plain], axis=1)),
            n_rows=sum(e.n_rows for e in members),
            added=None,
        )

    def at(self, met: Realisation) -> Iterator[Eliminated]:
        """Each of the experiments at the plant that they meet."""
        evaluation = SpectralEvaluation(self.one, met)
        left = self._left(evaluation)
        moved = None
        if evaluation.transient is not None:
            states = len(evaluation.transient)
            moved = np.stack([d[:states] for _, _, d in left if d is not None], axis=1)
        each = self._each(evaluation.jacobian(moved))
        for number, J, (r, Q, initial) in zip(self.numbers, each, left, strict=True):
            yield Eliminated(number, J, r, Q, initial)

    def _each(self, rows: FloatArray) -> list[FloatArray]:
        """Rows (…, all) of all experiments as those of each (…, rows)."""
        apart = rows.reshape(*rows.shape[:-1], len(self.one.lines.Y), len(self.members), -1)
        return [apart[..., i, :].reshape(*rows.shape[:-1], -1) for i in range(len(self.members))]

    def _left(self, evaluation: SpectralEvaluation) -> list[Left]:
        """What is left of each residual without its initial state."""
        residuals, T = self._each(evaluation.residual), evaluation.transient
        basis: list[FloatArray | None] = [T] * len(self.members)
        if T is not None and not self.one.lines.inside:
            basis = [*self._each(T)]
        if T is not None and self.alike and all(e.added is None for e in self.members):
            stacked = np.array(residuals)
            Q, delta = eliminate(T if self.one.lines.inside else self._each(T)[0], stacked.T)
            stacked = stacked - (Q @ stacked.T).T @ Q
            return [(r, Q, d) for r, d in zip(stacked, delta.T, strict=True)]
        return [
            bared(r, _with_rows(own, e.added))
            for r, own, e in zip(residuals, basis, self.members, strict=True)
        ]


def _with_rows(T: FloatArray | None, added: FloatArray | None) -> FloatArray | None:
    """Rows of both, where there are any."""
    if T is None or added is None:
        return added if T is None else T
    return np.concatenate([T, added])


def groups_of(experiments: Sequence[Experiment]) -> list[Lone | Repeats]:
    """Experiments, those at the same lines together."""
    groups: defaultdict[Hashable, list[int]] = defaultdict(list)
    for number, e in enumerate(experiments):
        groups[_kind(e) or number].append(number)
    made: list[Lone | Repeats] = []
    for numbers in groups.values():
        size = _size(experiments[numbers[0]])
        each = max(_TOGETHER // size, 1)
        for begin in range(0, len(numbers), each):
            some = numbers[begin : begin + each]
            if len(some) == 1:
                made.append(Lone(some[0], experiments[some[0]]))
            else:
                members = [cast(SpectralExperiment, experiments[i]) for i in some]
                made.append(Repeats(some, members))
    return made


def _size(e: Experiment) -> int:
    """Points of all channels; as many as are taken together for one of a kind of its own."""
    if not isinstance(e, SpectralExperiment) or isinstance(e.hold, InputHolds):
        return _TOGETHER
    return int(e.lines.U[0].size)


def _kind(e: Experiment) -> Hashable:
    """What repeats of an experiment have in common; None for one of its own."""
    if 2 * _size(e) > _TOGETHER:
        return None
    assert isinstance(e, SpectralExperiment)
    t = e.transient
    free = t and (t.dt, t.aliases, t.shared, t.z.tobytes())
    return (
        e.hold, e.lift, e.discrete, e.lines.U.shape, e.lines.Y.shape,
        e.lines.omega_input.tobytes(), e.points.z.tobytes(), free,
    )  # fmt: skip


def _apart(e: SpectralExperiment) -> SpectralExperiment:
    """An experiment with its weights taken out of its data."""
    if not e.lines.inside:
        return e
    size = np.where(e.lines.scale[0, 0] > 0, e.lines.scale[0, 0], 1.0)
    inputs, t = np.repeat(size, e.lines.aliases), e.transient
    lines = dataclasses.replace(e.lines, U=e.lines.U / inputs, Y=e.lines.Y / size, inside=False)
    return dataclasses.replace(
        e,
        lines=lines,
        points=Points(e.points.z, e.points.U / inputs),
        transient=t and dataclasses.replace(t, factor=t.factor / np.repeat(size, t.aliases)),
    )
