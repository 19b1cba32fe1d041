"""What a model leaves of a record: errors at the DFT lines and in time, transient taken off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft

from freqid.bias.apparent import state_space_of
from freqid.checks import ComplexArray, FloatArray
from freqid.data.record import Record
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.preparation import Options, prepare
from freqid.lti.bases import basis_of
from freqid.lti.holds.hold import Hold
from freqid.lti.projection import eliminate
from freqid.lti.realisation import Realisation
from freqid.lti.responses import Plane
from freqid.lti.sampled import Linearisation, StateSpace


@dataclass(frozen=True)
class LineErrors:
    """Errors Ŷ − Y (outputs, K) at lines ``omega`` (rad/s), and how often each line counts."""

    omega: FloatArray
    error: ComplexArray
    multiplicity: FloatArray


def line_errors(
    model: Any,
    record: Record,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
    initial_state: str = "estimate",
    weights: Any = None,
) -> LineErrors:
    """Errors of a model or an Estimate on a record at the lines of a band.

    ``hold`` is what the input is taken to do; None is what the record remembers. ``weights``, as
    in ``fit``, say which lines tell the initial state. Raises ValueError for channels that do not
    match.
    """
    model = getattr(model, "model", model)
    discrete, at, delay = matrices_of(model)
    shape = (at.C.shape[0], at.B.shape[1])
    integrates = not discrete and bool(np.abs(np.linalg.eigvals(at.A)).min(initial=1) < 1e-9)
    options = Options(hold, band, initial_state, skip_zero=integrates, delayed=delay > 0)
    experiment, _ = prepare(record, shape, weights, options, Plane() if discrete else None)
    if not isinstance(experiment, SpectralExperiment):
        raise ValueError(f"initial_state={initial_state!r} has no errors at lines; use 'estimate'")
    still = StateSpace(*(np.zeros((0, *M.shape)) for M in at))
    realisation = Realisation(Linearisation(at, still), basis_of(at, still), delay=delay)
    evaluation = experiment.at(realisation)
    rows = evaluation.residual
    if evaluation.transient is not None:
        Q, _ = eliminate(evaluation.transient, rows)
        rows = rows - (Q @ rows) @ Q
    size = experiment.line_scale
    scale = experiment.scale[:, 0] if size is None else size
    error = rows.view(complex).reshape(shape[0], -1) / scale
    step = 2 * np.pi / (experiment_length(record) * record.dt)
    lines = np.round(experiment.omega / step)
    real = (lines == 0) | (2 * lines == experiment_length(record))
    return LineErrors(experiment.omega, error, np.where(real, 1.0, 2.0))


def time_errors(errors: LineErrors, record: Record) -> FloatArray:
    """The same errors as signals (N, outputs); lines that are left out are zero."""
    N = experiment_length(record)
    E = np.zeros((len(errors.error), N // 2 + 1), complex)
    E[:, np.round(errors.omega * N * record.dt / (2 * np.pi)).astype(int)] = errors.error
    return scipy.fft.irfft(E, N, axis=-1).T


def experiment_length(record: Record) -> int:
    """Whole output samples, N."""
    return len(record.u) // record.factor


def matrices_of(model: Any) -> tuple[bool, StateSpace, float]:
    """Whether a model is a sampled one, its matrices and its delay in s."""
    matrices = getattr(model, "matrices", None)
    if isinstance(matrices, StateSpace) and hasattr(model, "dt"):
        return True, matrices, 0.0
    return False, state_space_of(model), float(getattr(model, "delay", 0.0))
