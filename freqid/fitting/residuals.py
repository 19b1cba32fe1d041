"""What a model leaves of a record: errors at the DFT lines and in time, transient taken off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError, steps
from freqid.data import Band, Record, StampedRecord, channel_counts
from freqid.fitting.cost.experiments import Evaluation, SpectralExperiment
from freqid.fitting.cost.lines import Lines
from freqid.fitting.reading import InitialState, Reading
from freqid.fitting.reading_sets import read_for
from freqid.frf import lines_of
from freqid.lti import Hold, PeriodicHold, Plane, eliminate
from freqid.models import Model, simulate


@dataclass(frozen=True)
class LineErrors:
    """Errors Ŷ − Y (outputs, K) at lines ``omega`` (rad/s), and how often each line counts.

    ``n_samples`` is N, the whole output samples, ``dt`` their sample time in s.
    """

    omega: FloatArray
    error: ComplexArray
    multiplicity: FloatArray
    n_samples: int
    dt: float
    # samples that show the lines, where there are fewer of them
    shown: int

    def in_time(self) -> FloatArray:
        """The same errors as signals (N, outputs); lines that are left out are zero."""
        N, scale = self.shown, self.shown / self.n_samples
        E = np.zeros((len(self.error), N // 2 + 1), complex)
        E[:, np.round(self.omega * self.n_samples * self.dt / (2 * np.pi)).astype(int)] = (
            scale * self.error
        )
        signals: FloatArray = scipy.fft.irfft(E, N, axis=-1).T
        return signals


def line_errors(
    model: Model,
    record: Record,
    hold: Hold | str | None = None,
    band: Band | None = None,
    initial_state: str = "estimate",
    offset: bool = False,
) -> LineErrors:
    """Errors of a model on a record at the lines of a band.

    ``hold`` is what the input is taken to do; None is what the record remembers. An ``offset`` of
    each output is free, as the initial state is. Raises ValueError for channels that do not match.
    """
    if initial_state == "zero":
        raise InputError("initial_state='zero' has no errors at lines; use 'estimate'")
    late = model.late
    reading = Reading.of(
        record, hold, band, initial_state=initial_state,  # type: ignore[arg-type]
        skip_zero=model.integrates, delayed=late,
    )  # fmt: skip
    return errors_of(model, reading.with_(offset=offset and not model.integrates))


def errors_at_stamps(model: Model, record: StampedRecord, hold: Hold | str | None) -> FloatArray:
    """Errors ŷ − y (N, outputs) of a model at the times of a log, the initial state fitted."""
    if model.dt or model.late:
        raise InputError(
            "samples at times of their own need a model in continuous time without delays; take "
            "record.regular(), which is resampled"
        )
    # the samples of a log come one after the other, all outputs of each
    return _at_samples(model, Reading.of(record, hold)).reshape(-1, model.n_outputs)


def errors_in_time(
    model: Model,
    record: Record,
    hold: Hold | str | None,
    initial_state: str,
    offset: bool,
    band: Band | None = None,
) -> FloatArray:
    """Errors ŷ − y (N, outputs) of a simulation, or their part in a band, the initial state fitted
    to what is compared.

    Those of lines in time, but where a model in continuous time integrates an input that is held
    from sample to sample: without the line at zero a constant force would be free.
    """
    if initial_state == "zero" and model.dt:
        return _of_a_sampled_model(model, record)
    state: InitialState = "zero" if initial_state == "zero" else "estimate"
    reading = Reading.of(record, hold, domain="time", initial_state=state)
    held = reading.hold
    every = isinstance(held, PeriodicHold) and np.isclose(held.period, record.input_dt, rtol=1e-9)
    plain = model.integrates and not (model.dt or model.late)
    if state == "zero" or (band is None and every and initial_state == "estimate" and plain):
        return _at_samples(model, reading).reshape(model.n_outputs, -1).T
    return line_errors(model, record, hold, band, initial_state, offset).in_time()


def _of_a_sampled_model(model: Model, record: Record) -> FloatArray:
    """Errors ŷ − y (N, outputs) from rest; ValueError for a record at another rate."""
    if record.factor > 1 or not np.isclose(record.dt, model.dt, rtol=1e-9):
        raise InputError(
            f"initial_state='zero' of a model sampled at {model.dt:g} s needs a record at that "
            f"rate, and this one has dt={record.dt:g} s; use 'estimate'"
        )
    return np.asarray(simulate(model, record.u, record.dt).outputs - record.outputs)


def _at_samples(model: Model, reading: Reading) -> FloatArray:
    """Errors ŷ − y in time, as the rows of an experiment, the initial state fitted."""
    (experiment,) = read_for((model.n_outputs, model.n_inputs), [reading])
    return _without_transient(experiment.at(model.still()))


def errors_of(model: Model, reading: Reading) -> LineErrors:
    """Errors of a model at the lines of a reading, its weights saying which tell the transient."""
    lines, rows = _left(model, reading.at_lines())
    return _of_rows(reading, lines, rows)


def errors_and_motions(model: Model, reading: Reading) -> tuple[FloatArray, FloatArray]:
    """Errors (N, outputs) of a model in time, and what initial states can add to them, as signals
    (q, N, outputs) of any size; none where these are known.
    """
    experiment, evaluation = _evaluated(model, reading.at_lines())
    lines, rows, Q = experiment.lines, evaluation.residual, np.zeros((0, 0))
    if evaluation.transient is not None:
        Q, _ = eliminate(evaluation.transient, rows)
        rows = rows - (Q @ rows) @ Q
    each = [_of_rows(reading, lines, row).in_time() for row in (rows, *Q)]
    return each[0], np.reshape(each[1:], (len(Q), *each[0].shape))


def _of_rows(reading: Reading, lines: Lines, rows: FloatArray) -> LineErrors:
    """Rows of an experiment as errors at its lines."""
    record = reading.data
    assert isinstance(record, Record)
    error = rows.view(complex).reshape(channel_counts(record)[0], -1) / lines.scale[:, 0]
    N, dt = lines_of(record)
    number = np.round(lines.omega * N * dt / (2 * np.pi))
    multiplicity = np.where((number == 0) | (2 * number == N), 1.0, 2.0)
    return LineErrors(lines.omega, error, multiplicity, N, dt, len(record.u) // record.factor)


def errors_of_response(model: Model, reading: Reading) -> tuple[ComplexArray, FloatArray]:
    """Errors of a model at the lines of a response and the roots of their weights, each (outputs,
    inputs, K).
    """
    lines, rows = _left(model, reading.at_lines())
    error = rows.view(complex).reshape(lines.scale.shape)
    return np.asarray(error / np.where(lines.scale > 0, lines.scale, 1)), lines.scale


def _left(model: Model, reading: Reading) -> tuple[Lines, FloatArray]:
    """Lines of a reading, and the rows that a model leaves there without their transient."""
    experiment, evaluation = _evaluated(model, reading)
    return experiment.lines, _without_transient(evaluation)


def _evaluated(model: Model, reading: Reading) -> tuple[SpectralExperiment, Evaluation]:
    """A reading as an experiment, and what a model makes of it."""
    if isinstance(reading.data, Record):
        steps("dt of the record", reading.data.dt, model.dt or reading.data.dt, least=1)
    shape, plane = (model.n_outputs, model.n_inputs), Plane() if model.dt else None
    (experiment,) = read_for(shape, [reading], plane)
    assert isinstance(experiment, SpectralExperiment)
    return experiment, experiment.at(model.still())


def _without_transient(evaluation: Evaluation) -> FloatArray:
    rows = evaluation.residual
    if evaluation.transient is None:
        return rows
    Q, _ = eliminate(evaluation.transient, rows)
    return np.asarray(rows - (Q @ rows) @ Q)
