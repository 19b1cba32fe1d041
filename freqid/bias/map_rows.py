"""The rows of a bias map: what is asked of each, and a chunk of them answered together."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.bias.apparent import held_response
from freqid.bias.asymptotic import grey_asymptote, model_responses
from freqid.bias.batched_fit import Batch, Problem, solve
from freqid.bias.conditions import Conditions
from freqid.checks import BoolArray, FloatArray, InputError
from freqid.excitation import InputSpectrum
from freqid.fitting import (
    Answers,
    Evidence,
    GreyStructure,
    SearchOptions,
    descend,
    findings,
    uninterrupted,
)
from freqid.lti import TOLERANCE, Hold, as_hold
from freqid.models import GreyBox

# times that nodes are added to a row for the answer that it led to
_ROUNDS = 3
# least eigenvalue of JᵀJ with unit columns: below, the parameters are told apart by rounding
_DETERMINED = 1e-14


@dataclass(frozen=True)
class Row:
    """One fit of a map; labels are what the table shows."""

    plant_label: str
    spectrum_label: str
    hold_label: str
    factor: int
    spectrum: InputSpectrum
    hold: Hold | str | None

    def conditions(self, shared: Conditions) -> Conditions:
        """Those of all rows, with this one's spectrum and factor."""
        sampling = dataclasses.replace(shared.sampling, factor=self.factor)
        return dataclasses.replace(shared, spectrum=self.spectrum, sampling=sampling)


@dataclass
class Answer:
    """Estimates (P,) of one row, or why there are none."""

    values: FloatArray
    cost: float
    converged: bool
    message: str = ""


def answer_chunk(model: GreyBox, rows: Sequence[Row], shared: Conditions) -> list[Answer]:
    """All rows of one plant and one kind of hold. A row that fails says so; the others stand."""
    count = len(model.free_parameters)
    answers = [Answer(np.full(count, np.nan), np.nan, False) for _ in rows]
    problems: list[Problem] = []
    kept: list[int] = []
    for i, row in enumerate(rows):
        try:
            problems.append(_problem(model, row, shared))
            kept.append(i)
        except (InputError, ArithmeticError) as error:
            answers[i].message = str(error)
    bounded = any(np.isfinite([p.lower, p.upper]).any() for p in model.free_parameters)
    single = list(kept)
    # the batch knows neither bounds nor delays
    if kept and not bounded and not model.delay_sources:
        single = _together(model, [rows[i] for i in kept], shared, problems, kept, answers)
    for i in single:
        answers[i] = _alone(model, rows[i], shared)
    for i in kept:
        if answers[i].converged and not answers[i].message:
            certain = Evidence(model.free_parameters, answers[i].values, np.zeros(count))
            notes = findings(certain)
            answers[i].message = "; ".join(notes)
    for i in kept:
        told = [answers[i].message, *rows[i].conditions(shared).folded_together()]
        answers[i].message = "; ".join(filter(None, told))
    return answers


def _problem(model: GreyBox, row: Row, shared: Conditions, at: FloatArray | None = None) -> Problem:
    """Nodes for a row, fine enough for the model at its own values and at ``at`` (scaled)."""
    structure = GreyStructure(model)
    conditions = row.conditions(shared)
    hold = as_hold(row.hold, conditions.sampling.dt, conditions.sampling.hold)
    points = [structure.start] if at is None else [structure.start, at]
    seen = [model_responses(structure, x, hold) for x in points]
    expected = conditions.expected(held_response(model, conditions.sampling.hold), *seen)
    count = 2 * expected.response.size
    if count < len(structure.names):
        raise InputError(
            f"spectrum has {count} real values for {len(structure.names)} free parameters; it does "
            "not determine them: add lines or fix parameters"
        )
    return Problem(
        expected.frequency, expected.weight, expected.response, hold, len(expected.panels)
    )


def _together(
    model: GreyBox,
    rows: Sequence[Row],
    shared: Conditions,
    problems: list[Problem],
    kept: Sequence[int],
    answers: list[Answer],
) -> list[int]:
    """Fill in the answers of the batch; return the rows that it could not settle."""
    batch = Batch(model, problems)
    found = solve(batch)
    for _ in range(_ROUNDS):
        # lines among the nodes have no panels, and are exact
        coarse = np.flatnonzero(batch.unresolved(found.values, 10 * TOLERANCE) & found.converged)
        if len(coarse) == 0:
            break
        finer: list[int] = []
        for i in coarse.tolist():
            try:
                problems[i] = _problem(model, rows[i], shared, found.values[i])
                finer.append(i)
            except InputError:
                # told by the fit of that row alone
                found.converged[i] = False
        if not finer:
            break
        batch = Batch(model, problems)
        part = Batch(model, [problems[i] for i in finer])
        again = descend(part, found.values[finer])
        found.values[finer], found.cost[finer] = again.values, again.cost
        found.converged[finer] = again.converged
    settled = found.converged & _determined(batch, found)
    for place, i in enumerate(kept):
        if settled[place]:
            answers[i] = Answer(found.values[place] * batch.scale, float(found.cost[place]), True)
    return [i for place, i in enumerate(kept) if not settled[place]]


def _determined(batch: Batch, found: Answers) -> BoolArray:
    """Whether the parameters of each problem are told apart by its spectrum, (S,)."""
    H = batch.normal(found.values, np.arange(len(found.values)))[2]
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.sqrt(np.einsum("sii->si", H))
        scaled = H / (size[:, :, None] * size[:, None, :])
    scaled = np.where(np.isfinite(scaled), scaled, 0)
    return np.linalg.eigvalsh(scaled)[:, 0] > _DETERMINED


def _alone(model: GreyBox, row: Row, shared: Conditions) -> Answer:
    try:
        conditions = row.conditions(shared)
        at = held_response(model, conditions.sampling.hold)
        est, _ = grey_asymptote(model, at, conditions, row.hold, SearchOptions())
    except (InputError, ArithmeticError, np.linalg.LinAlgError) as error:
        count = len(model.free_parameters)
        return Answer(np.full(count, np.nan), np.nan, False, str(error))
    # a map that is ended from the keyboard ends, in place of one row
    uninterrupted(est.message)
    return Answer(est.values, est.cost, est.converged, "; ".join(est.signs))
