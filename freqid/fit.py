"""``fit``: physical parameters from records or frequency responses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freqid.black_box import fit_black_box
from freqid.checks import FloatArray, choice, unknown
from freqid.estimate import Estimate
from freqid.experiments import Realisation
from freqid.frequency_response import FrequencyResponse
from freqid.holds import Hold
from freqid.models import GreyBox
from freqid.optimise import Objective, Solution, minimise, noise_variance
from freqid.preparation import Options, enough_rows, prepare
from freqid.rational import OutputError
from freqid.record import Record
from freqid.responses import Linearisation, StateSpace
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
        model: a GreyBox, or OutputError(order) for a black box.
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
    sets = [data] if isinstance(data, (Record, FrequencyResponse)) else list(data)
    if not sets:
        raise ValueError("data=[] holds no experiment; give at least one record or response")
    all_weights = weights if isinstance(weights, (list, tuple)) else [weights] * len(sets)
    if len(all_weights) != len(sets):
        raise ValueError(f"weights has {len(all_weights)} entries for {len(sets)} experiments")
    options = Options(hold, band, initial_state, domain)
    if isinstance(model, OutputError):
        if start is not None:
            raise ValueError("start has no meaning for a black box, which needs none; leave it out")
        return fit_black_box(model, sets, all_weights, options)
    if not isinstance(model, GreyBox):
        raise ValueError(
            f"model={type(model).__name__} is not a model; expected a GreyBox or OutputError"
        )
    model = _started(model, start)
    structure = GreyStructure(model)
    if not structure.names:
        raise ValueError("model has no free parameter; free one with model.free(name)")
    at = model.state_space()
    shape = (at.C.shape[0], at.B.shape[1])
    pairs = [prepare(d, shape, w, options) for d, w in zip(sets, all_weights, strict=True)]
    experiments = [experiment for experiment, _ in pairs]
    enough_rows(experiments, len(structure.names))
    objective = Objective(structure, experiments)
    solution = minimise(objective, structure.values / structure.scale)
    return _estimate(structure, objective, solution, pairs[0][1], sets[0].dt)


def _started(model: GreyBox, start: Mapping[str, float] | None) -> GreyBox:
    if start is None:
        return model
    for name in start:
        if name not in model.values:
            raise ValueError(unknown("start", name, model.values))
    return model.with_values(**start)


def _estimate(
    structure: GreyStructure,
    objective: Objective,
    solution: Solution,
    hold: Hold,
    dt: float,
) -> Estimate:
    point, scale = solution.point, structure.scale
    values = solution.x * scale
    energy = sum(e.energy for e in objective.experiments)
    n_rows = sum(e.n_rows for e in objective.experiments)
    noise = noise_variance(objective, point, len(values))
    u = uncertainty(point.jacobian / scale, values, structure.names, noise, np.sqrt(energy))
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
