"""How much noise that lines of responses share widens what black boxes explain of it by chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.data import PeriodicResponse
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.periodic_experiments import PeriodicExperiment
from freqid.fitting.uncertainty.evenness import (
    err_together,
    line_scores,
    may_be_tied,
    tied,
    together,
)
from freqid.lti import directions

# directions of unknowns below this part of the largest are none
_LOOSE = 1e-7
# a line of which a black box leaves less says nothing
_TAKEN = 0.2


@dataclass(frozen=True)
class Chance:
    """What chance explains: so many ``times`` what it would if each real value had noise of its
    own, and as on so many ``degrees`` of freedom, the noise being told by ``lines`` values.

    Variances that differ from direction to direction scatter as fewer of them do that are alike
    (Satterthwaite, Biometrics Bulletin 2, 1946), and so do those that few lines tell.
    """

    times: float
    degrees: float
    lines: float = np.inf

    @classmethod
    def of(cls, scores: FloatArray) -> Chance:
        """Of what each line tells along directions (q, lines), in units of its own noise."""
        variances = np.linalg.svd(scores, compute_uv=False) ** 2
        total, each = float(variances.sum()), (scores**2).sum(axis=0)
        if total == 0:
            return cls(1.0, float(len(scores)))
        # of Gaussian values the fourth powers are three times the squares of the variances
        told = 3 * total**2 / float(each @ each)
        return cls(max(total / len(scores), 1.0), total**2 / float(variances @ variances), told)


def chance_of(boxes: Sequence[tuple[Objective, FloatArray]], degrees: float) -> Chance:
    """What chance explains on so many ``degrees`` of freedom of black boxes, each an objective and
    its unknowns: of lines that share noise, and of outputs that do.
    """
    plain, scores = Chance(shared(boxes), degrees), [_along_outputs(*box) for box in boxes]
    if all(told is None for told, _ in scores):
        return plain
    every = scipy.linalg.block_diag(*(alone if told is None else told for told, alone in scores))
    own = Chance.of(every)
    part = min(own.degrees / len(every), 1.0)
    return Chance(max(plain.times, own.times), part * degrees, own.lines)


def _along_outputs(objective: Objective, x: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """What noise tells along all directions of a black box at its minimum, at each line, in units
    of it, where outputs share it, and else None; and the same as if each had its own.
    """
    experiments = [e for e in objective.experiments if isinstance(e, SpectralExperiment)]
    if len(experiments) < len(objective.experiments) or not any(
        e.n_channels[0] > 1 for e in experiments
    ):
        return None, np.eye(len(x))
    left, ways, variance = _along(objective, x, experiments)
    alone = np.eye(len(ways[0]))
    if not any(err_together(rows, e) for rows, e in zip(left, experiments, strict=True)):
        return None, alone
    told = [line_scores(r, own, e) for r, own, e in zip(left, ways, experiments, strict=True)]
    return np.concatenate(told, axis=1) / np.sqrt(variance), alone


def _along(
    objective: Objective, x: FloatArray, experiments: Sequence[SpectralExperiment]
) -> tuple[list[FloatArray], list[FloatArray], float]:
    """What is left of each experiment (rows,), the directions of all unknowns there (q, rows), and
    the variance of a value.
    """
    realisation = objective.structure.realise(x)
    left, slopes = [], []
    for e in experiments:
        evaluation = e.at(realisation)
        rows, Q, delta = projected(evaluation)
        J = evaluation.jacobian(delta)
        left.append(rows)
        slopes.append(J - (J @ Q.T) @ Q)
    ways = directions(np.concatenate(slopes, axis=1), _LOOSE)[2]
    ends = np.cumsum([len(rows) for rows in left])[:-1]
    freedom = max(sum(map(len, left)) - len(ways), 1)
    variance = sum(float(rows @ rows) for rows in left) / freedom
    each = [np.ascontiguousarray(own) for own in np.split(ways, ends, axis=1)]
    return left, each, variance


class InputNoise(Protocol):
    """What errors of inputs that a reference explained add to those of the outputs."""

    def along(
        self,
        experiments: Sequence[SpectralExperiment],
        ways: Sequence[FloatArray],
        left: Sequence[FloatArray],
    ) -> FloatArray | None:
        """What noise tells along ``ways`` (q, rows of an experiment) at each line (q, lines) where
        these are ``left`` (rows,); None where it is not known.
        """
        ...


def noise_freedom(data: Sequence[object]) -> float:
    """Real values that tell the noise of periodic data: of covariances that are estimates, as many
    as theirs, since what speaks loudest may stand on few lines; infinite for other data.
    """
    return sum(2.0 * d.freedom if isinstance(d, PeriodicResponse) else np.inf for d in data)


def shared(boxes: Sequence[tuple[Objective, FloatArray]]) -> float:
    """How much larger a cost falls by chance than if each real value had noise of its own, from
    the minima of black boxes, each an objective and its unknowns; at least 1.

    Lines of local models share their windows, entries of a response those of their neighbours that
    were measured with them; means whose covariance few periods told badly weigh too much or little.
    """
    parts: list[tuple[FloatArray, SpectralExperiment]] = []
    joined = alone = 0.0
    for objective, x in boxes:
        if any(isinstance(e, PeriodicExperiment) for e in objective.experiments):
            more = _of_means(objective, x)
            joined, alone = joined + more[0], alone + more[1]
        experiments = [e for e in objective.experiments if isinstance(e, SpectralExperiment)]
        entries = any(may_be_tied(e) for e in experiments)
        if not (entries or any(e.reach for e in experiments)):
            continue
        if not entries:
            realisation = objective.structure.realise(x)
            parts += [(projected(e.at(realisation))[0], e) for e in experiments]
            continue
        left, ways, even = _along(objective, x, experiments)
        parts += zip(left, experiments, strict=True)
        count = sum(map(len, left))
        share = count / max(count - len(ways[0]), 1)
        for rows, e, own in zip(left, experiments, ways, strict=True):
            plain = even * float(np.sum(own**2))
            alone += plain
            joined += tied(rows, own, e) * share if may_be_tied(e) else plain
    wider = together(parts) if parts else 1.0
    return wider * max(joined / alone if alone > 0 else 1.0, 1.0)


def _of_means(objective: Objective, x: FloatArray) -> tuple[float, float]:
    """Σ variances along all directions of a black box beside means: as its lines show them, and as
    if all were alike.

    What is left of a line is made as large as it was before the box took its part (HC2: MacKinnon
    and White, J. Econometrics 29, 1985).
    """
    realisation = objective.structure.realise(x)
    means = [e for e in objective.experiments if isinstance(e, PeriodicExperiment)]
    at = [e.at(realisation) for e in means]
    ways = directions(np.concatenate([a.jacobian(None) for a in at], axis=1), _LOOSE)[2]
    left = [a.residual for a in at]
    ends = np.cumsum([len(rows) for rows in left])[:-1]
    joined = size = total = 0.0
    for e, rows, own in zip(means, left, np.split(ways, ends, axis=1), strict=True):
        p = len(e.data.response)
        each = np.ascontiguousarray(own).view(complex).reshape(len(own), -1, p)
        along = (each.conj() * rows.view(complex).reshape(-1, p)).sum(axis=2)
        taken = (np.abs(each) ** 2).sum(axis=(0, 2)) / p / 2
        kept = np.maximum(1 - taken, _TAKEN)
        joined += float(((np.abs(along) ** 2).sum(axis=0) / kept).sum()) / 2
        size, total = size + float(rows @ rows), total + len(rows)
    freedom = max(total - len(ways), 1.0)
    return joined, size / freedom * len(ways)
