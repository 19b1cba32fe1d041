"""``fit``: physical parameters from records or frequency responses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freqid.checks import FloatArray, choice, unknown
from freqid.estimate import Estimate
from freqid.experiments import Experiment, Realisation, SpectralExperiment, TimeExperiment
from freqid.frequency_response import FrequencyResponse
from freqid.holds import Hold, PeriodicHold, as_hold
from freqid.models import GreyBox
from freqid.optimise import Objective, Solution, minimise
from freqid.record import Record
from freqid.responses import Linearisation, StateSpace
from freqid.spectra import spectra
from freqid.trust import physical_warnings, uncertainty


class GreyStructure:
    """A grey box as the optimiser sees it: free parameters in units of their own size."""

    def __init__(self, model: GreyBox) -> None:
        self.model = model
        self.parameters = model.free_parameters
        self.names = [p.name for p in self.parameters]
        self.values = np.array([p.value for p in self.parameters])
        self.scale = np.where(self.values == 0, 1, np.abs(self.values))
        self.lower = np.array([p.lower for p in self.parameters]) / self.scale
        self.upper = np.array([p.upper for p in self.parameters]) / self.scale
        self._fixed = model.values

    def realise(self, x: FloatArray) -> Realisation:
        """Matrices at x and their derivatives by x."""
        values = self._fixed | dict(zip(self.names, (x * self.scale).tolist(), strict=True))
        at, d = self.model.linearise(values, self.names)
        if not all(np.isfinite(M).all() for M in (*at, *d)):
            raise ArithmeticError("the matrices are not finite")
        by = self.scale[:, None, None]
        return Realisation.of(Linearisation(at, StateSpace(*(M * by for M in d))))

    def describe(self, x: FloatArray) -> str:
        """The parameter values at x."""
        return ", ".join(f"{n}={v:g}" for n, v in zip(self.names, x * self.scale, strict=True))


def fit(
    model: Any,
    data: Record | FrequencyResponse | Sequence[Record | FrequencyResponse],
    *,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
    weights: Any = None,
    initial_state: str = "estimate",
    start: Mapping[str, float] | None = None,
    domain: str = "frequency",
) -> Estimate:
    """Estimate a model's free parameters by weighted least squares on the lines of a band.

    Minimises Σ w |Y − G U − transient|² (the bias integral, paper eq. 2, for w = 1).

    Args:
        model: a GreyBox.
        data: a Record, a FrequencyResponse, or several; each record has its own initial state.
        hold: what the input did between its samples; None is what each record remembers, a name
            means that hold at the record's own sample time, as other tools assume.
        band: (low, high) in Hz; None takes all lines, and the cost is the output error of the
            time domain (Parseval). Where the input is faster than the output this is the input's
            band.
        weights: None for ones (for a response its input spectrum, where known), ``"noise"`` for
            1/variance, or an array, (lines,) or (outputs, lines).
        initial_state: ``"estimate"`` (free), ``"zero"`` (the sampled model starts at rest) or
            ``"steady"`` (no transient).
        start: parameter values to begin from; the model's own where not given.
        domain: ``"frequency"`` or ``"time"``, the paper's output error.

    Returns an Estimate. Raises ValueError for arguments that do not fit the data or the model.

    Sources: Ljung, System Identification, 1999, section 7.7; Pintelon and Schoukens, System
    Identification: A Frequency Domain Approach, 2012, chapter 9.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.chirp(2, 40, 2, 1e-3), dt=1e-3)
    >>> est = fq.fit(fq.first_order(b=80, a=130), record, band=(2, 40))
    >>> round(est["a"], 6), round(est["b"], 6)
    (100.0, 100.0)
    """
    choice("domain", domain, ("frequency", "time"))
    choice("initial_state", initial_state, ("estimate", "zero", "steady"))
    if not isinstance(model, GreyBox):
        raise ValueError(f"model={type(model).__name__} is not a model; expected a GreyBox")
    model = _started(model, start)
    structure = GreyStructure(model)
    if not structure.names:
        raise ValueError("model has no free parameter; free one with model.free(name)")
    sets = [data] if isinstance(data, (Record, FrequencyResponse)) else list(data)
    if not sets:
        raise ValueError("data=[] holds no experiment; give at least one record or response")
    all_weights = weights if isinstance(weights, (list, tuple)) else [weights] * len(sets)
    if len(all_weights) != len(sets):
        raise ValueError(f"weights has {len(all_weights)} entries for {len(sets)} experiments")
    experiments: list[Experiment] = []
    holds: list[Hold] = []
    for item, w in zip(sets, all_weights, strict=True):
        experiment, assumed = _experiment(item, model, hold, band, w, initial_state, domain)
        experiments.append(experiment)
        holds.append(assumed)
    n_rows = sum(e.n_rows for e in experiments)
    if n_rows < len(structure.names):
        raise ValueError(
            f"data hold {n_rows} real values for {len(structure.names)} free parameters; "
            "widen the band, lengthen the record or fix parameters"
        )
    objective = Objective(structure, experiments)
    solution = minimise(objective, structure.values / structure.scale)
    return _estimate(structure, objective, solution, holds[0], sets[0].dt, n_rows)


def _started(model: GreyBox, start: Mapping[str, float] | None) -> GreyBox:
    if start is None:
        return model
    for name in start:
        if name not in model.values:
            raise ValueError(unknown("start", name, model.values))
    return model.with_values(**start)


def _experiment(
    data: Any,
    model: GreyBox,
    hold: Hold | str | None,
    band: tuple[float, float] | None,
    weights: Any,
    initial_state: str,
    domain: str,
) -> tuple[Experiment, Hold]:
    """One data set as residuals, and the hold that was assumed for it."""
    if not isinstance(data, (Record, FrequencyResponse)):
        raise ValueError(f"data holds a {type(data).__name__}; expected Record or FrequencyResponse")
    at = model.state_space()
    shape = (at.C.shape[0], at.B.shape[1])
    if isinstance(data, FrequencyResponse):
        given = data.response.shape[:2]
    else:
        given = (data.n_outputs, data.n_inputs)
    if given != shape:
        raise ValueError(
            f"data have {given[0]} outputs and {given[1]} inputs; the model has {shape[0]} and "
            f"{shape[1]}"
        )
    if isinstance(data, FrequencyResponse):
        if domain == "time":
            raise ValueError("domain='time' needs a Record, not a FrequencyResponse")
        return _response_experiment(data, hold, band, weights)
    # a name means the hold at the record's own sample time: that of the input as it was kept
    assumed = as_hold(hold, data.input_dt, data.hold)
    if domain == "time" or initial_state == "zero":
        if initial_state != "steady":
            return _time_experiment(data, assumed, band, weights, initial_state), assumed
    known = isinstance(assumed, PeriodicHold) and np.isclose(assumed.period, data.input_dt, 1e-9)
    s = spectra(data, band, lifted=bool(known))
    w = _weights(weights, s.Y.shape)
    free = initial_state == "estimate"
    return SpectralExperiment.of_record(s, data.n_inputs, assumed, w, free), assumed


def _response_experiment(
    frf: FrequencyResponse, hold: Hold | str | None, band: Any, weights: Any
) -> tuple[Experiment, Hold]:
    if isinstance(hold, str) and hold != "bl" and frf.dt == 0:
        raise ValueError(f"hold={hold!r} needs a sample time and this response has dt=0; give a Hold")
    continuous = as_hold("bl", 1.0)
    assumed = as_hold(hold, frf.dt or 1.0, frf.hold or continuous)
    if band is not None:
        frf = frf.select(band)
    shape = frf.response.shape
    if weights is None:
        w = np.ones(shape) if frf.input_spectrum is None else frf.input_spectrum
    elif isinstance(weights, str):
        choice("weights", weights, ("noise",))
        if frf.variance is None:
            raise ValueError("weights='noise' needs frf.variance, and this response has none")
        w = 1 / frf.variance
    else:
        w = _weights(weights, shape)
    return SpectralExperiment.of_response(frf, assumed, w), assumed


def _time_experiment(
    record: Record, assumed: Hold, band: Any, weights: Any, initial_state: str
) -> Experiment:
    if weights is not None:
        raise ValueError("weights need domain='frequency' and an initial state that is not 'zero'")
    if not isinstance(assumed, PeriodicHold) or abs(assumed.period / record.input_dt - 1) > 1e-9:
        raise ValueError(
            f"hold={assumed!r} cannot be simulated from an input at {record.input_dt:g} s; use "
            "domain='frequency' with initial_state='estimate', or keep the input when decimating"
        )
    s = spectra(record, band)
    return TimeExperiment(record, assumed, None if band is None else s, initial_state == "estimate")


def _weights(weights: Any, shape: tuple[int, ...]) -> FloatArray:
    if weights is None:
        return np.ones(shape)
    if isinstance(weights, str):
        choice("weights", weights, ("noise",))
        raise ValueError(
            "weights='noise' needs the variance at each line, which a record does not carry; give "
            "an array of 1/variance, or fit a FrequencyResponse with a variance"
        )
    array = np.asarray(weights, dtype=float)
    if array.shape not in ((shape[-1],), shape):
        raise ValueError(f"weights has shape {array.shape}; expected ({shape[-1]},) or {shape}")
    if not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise ValueError("weights must be finite and not negative, with at least one above zero")
    return array


def _estimate(
    structure: GreyStructure,
    objective: Objective,
    solution: Solution,
    hold: Hold,
    dt: float,
    n_rows: int,
) -> Estimate:
    point, scale = solution.point, structure.scale
    values = solution.x * scale
    energy = sum(e.energy for e in objective.experiments)
    unknowns = len(values) + sum(len(d) for d in point.initial if d is not None)
    freedom = max(n_rows - unknowns, 1)
    u = uncertainty(
        point.jacobian / scale, values, structure.names, point.cost / freedom, np.sqrt(energy)
    )
    warnings = [] if solution.converged else [f"not converged: {solution.message}"]
    warnings += u.warnings + physical_warnings(structure.parameters, values)
    return Estimate(
        model=structure.model.with_values(**dict(zip(structure.names, values, strict=True))),
        names=structure.names,
        values=values,
        nominal=structure.values,
        units=[p.unit for p in structure.parameters],
        covariance_matrix=u.covariance,
        cost=point.cost,
        fit_percent=100 * (1 - np.sqrt(point.cost / energy)),
        converged=solution.converged,
        message=solution.message,
        n_evaluations=objective.n_evaluations,
        hold=hold,
        dt=dt,
        n_rows=n_rows,
        warnings=warnings,
    )
