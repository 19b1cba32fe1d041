"""Estimate: identified parameters, how certain they are, and whether they may be trusted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import (
    ComplexArray,
    FloatArray,
    InputError,
    choice,
    finite,
    flag,
    processes,
    unknown,
)
from freqid.data import DataSet, FrequencyResponse
from freqid.fitting.cost.objective import Answering
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding, Inquired
from freqid.fitting.questioned import Questioned
from freqid.fitting.search.verdict import Witness
from freqid.fitting.separate import with_unknowns
from freqid.fitting.shown import Shown
from freqid.fitting.tied import with_tied
from freqid.fitting.uncertainty.error_bars import derived, modes, pole_scatter, response_variance
from freqid.fitting.uncertainty.minimum import Minimum, Spread, quantile, values_that_tell
from freqid.fitting.uncertainty.profiles import profile_intervals
from freqid.lti import Hold
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

# half-width of a 95 % interval of a normal variable, in standard deviations
Z95 = 1.959963984540054


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Questioned, Shown):
    """The result of ``fit``: parameters, how certain they are, and what speaks against them.

    Attributes:
        model: the model at the estimate: GreyBox, DiscreteModel or ContinuousModel.
        names, values: names of the P values that were estimated, and these, in their units.
        nominal: the values that the model itself has, (P,); NaN where it has none.
        units: unit of each value.
        uncertainty: how the estimate scatters, or the covariance itself, (P, P).
        cost: the data's part of the least weighted sum of squared errors, in output units squared,
            or in the noise's variance where weights bring it.
        fit_percent: 100·(1 − √(cost / energy of the data fitted)).
        converged: whether the descent ended in a minimum; ``message`` says how it ended.
        n_evaluations: evaluations of the cost, all starts together.
        n_rows: real values of the data.
        hold: what the input was taken to do between its samples.
        dt: sample time of the output in s; 0 for a continuous response.
        n_starts, n_agreed: starts that were tried, and those that ended in this minimum.
        signs: the ``warnings`` that the fit itself gave.
        problem: the Minimum (structure, experiments, prior), for what asks for more.
        data: the data sets that were fitted; ``band`` (Hz) and ``weights`` as they were given.
        call: the call of ``fit``, to be made again; ``notes``: what was done on the way.
        testimony: what the ``witness`` is heard on; ``inquiry``: what asks the ``suspects``.
    """

    model: Any
    names: Sequence[str]
    values: FloatArray
    nominal: FloatArray
    units: Sequence[str]
    uncertainty: Spread | FloatArray
    cost: float
    fit_percent: float
    converged: bool
    message: str
    n_evaluations: int
    hold: Hold
    dt: float
    n_rows: int
    signs: Sequence[Finding] = field(default_factory=list)
    n_starts: int = 1
    n_agreed: int = 1
    problem: Minimum | None = field(default=None, repr=False)
    data: Sequence[DataSet] = ()
    band: tuple[float, float] | None = None
    weights: Any = None
    call: str = ""
    testimony: Callable[[], Witness] | None = field(default=None, repr=False)
    inquiry: Inquired | None = field(default=None, repr=False)
    notes: list[str] = field(default_factory=list)

    @property
    def minimum(self) -> Minimum:
        """The point of least cost. Raises ValueError for an estimate that has none any more."""
        if self.problem is None:
            raise InputError("this estimate does not hold its cost any more; fit again")
        return self.problem

    @property
    def scatter(self) -> Spread:
        """How the estimate scatters: covariance, and how it is carried to modes and responses."""
        own = self.uncertainty
        return own if isinstance(own, Spread) else Spread(np.ones(len(self.values)), given=own)

    @property
    def _unknowns(self) -> tuple[Answering, FloatArray, Spread]:
        """The model as the optimiser saw it, its unknowns, and how they scatter."""
        if self.problem is not None and isinstance(self.uncertainty, Spread):
            return self.problem.structure, self.problem.x, self.uncertainty
        if (kept := vars(self).get("box")) is not None:
            return kept, np.zeros(len(kept.half)), kept.spread
        if not isinstance(self.model, GreyBox):
            return self.minimum.structure, self.minimum.x, self.scatter
        # an estimate that is not of a fit: the grey box itself still tells all that is asked
        model, at = with_unknowns(self.model, self.names)
        structure = GreyStructure(model)
        own = self.covariance_matrix[np.ix_(at, at)]
        given = own / np.outer(structure.scale, structure.scale)
        return structure, structure.start, Spread(structure.scale, given=given)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore; an estimate of version 0.1.0 has lost its cost, and what it had not computed."""
        if not isinstance(state.get("problem"), Minimum):
            state["problem"] = None
        state.setdefault("signs", state.get("warnings", []))
        if not isinstance(state["uncertainty"], Spread | np.ndarray):
            unknown = np.full((len(state["values"]),) * 2, np.nan)
            state["uncertainty"] = state.get("covariance_matrix", unknown)
        self.__dict__.update(state)

    def __getitem__(self, name: str) -> float:
        if isinstance(name, str) and name in self.names:
            return float(self.values[list(self.names).index(name)])
        fixed = getattr(self.model, "values", {})
        if isinstance(name, str) and name in fixed:
            return float(fixed[name])
        raise KeyError(unknown("parameter", name, self.names))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    @property
    def hold_period(self) -> float | None:
        """Period of the hold in s; None for a band-limited input."""
        return getattr(self.hold, "period", None)

    @cached_property
    def covariance_matrix(self) -> FloatArray:
        """Covariance of the parameters, (P, P)."""
        return self.scatter.covariance

    @property
    def parameters(self) -> pd.DataFrame:
        """Value, standard error, 95 % interval, nominal value and unit of each parameter.

        The free ones in the order of ``names``, then those tied to them.
        """
        from freqid.fitting.table import Table

        # what is changed of a table is not changed of the estimate
        return Table(self._parameters.copy())

    @cached_property
    def _parameters(self) -> pd.DataFrame:
        import pandas as pd

        std = np.sqrt(np.diag(self.covariance_matrix))
        lower, upper = self._limits(std)
        free = pd.DataFrame(
            {
                "value": self.values, "std": std, "lower": lower, "upper": upper,
                "nominal": self.nominal, "unit": list(self.units),
            },
            index=pd.Index(list(self.names), name="parameter"),
        )  # fmt: skip
        return with_tied(free, self, quantile(self.told_by, 0.95))

    @cached_property
    def told_by(self) -> float:
        """How many values tell the size of the noise; infinite where it is known otherwise."""
        return values_that_tell(self.problem)

    def _limits(self, std: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ends of 95 % intervals, inside the bounds."""
        half = quantile(self.told_by, 0.95) * std
        lower, upper = self.values - half, self.values + half
        own = self.problem is not None and isinstance(self.model, GreyBox)
        if not own or self.scatter.given is not None:
            return lower, upper
        return self.minimum.inside_bounds(self.scatter.change, std, lower, upper)

    @cached_property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the parameters; infinite where the data do not determine them."""
        return self._square(self.covariance_matrix)

    @cached_property
    def correlation(self) -> pd.DataFrame:
        """Correlation of the parameters."""
        std = np.sqrt(np.diag(self.covariance_matrix))
        with np.errstate(invalid="ignore", divide="ignore"):
            return self._square(self.covariance_matrix / np.outer(std, std))

    def _square(self, matrix: FloatArray) -> pd.DataFrame:
        import pandas as pd

        return pd.DataFrame(matrix, index=list(self.names), columns=list(self.names))

    def frequency_response(
        self, omega: ArrayLike | None = None, hold: Hold | None = None
    ) -> FrequencyResponse:
        """Response of the estimated model at ``omega`` (rad/s) with its variance.

        ``hold=None`` gives the continuous response of a continuous-time model. Without ``omega``,
        200 frequencies up to the Nyquist limit. The variance is to first order in the covariance.
        """
        if omega is None:
            omega = np.geomspace(1e-3, 1, 200) * np.pi / self.dt
        frf: FrequencyResponse = self.model.frequency_response(omega, hold)
        if self.problem is None and not isinstance(self.model, GreyBox) and "box" not in vars(self):
            return frf
        return replace(frf, variance=response_variance(*self._unknowns, frf.omega, hold))

    def derived(self, function: Callable[[GreyBox], ArrayLike]) -> tuple[FloatArray, FloatArray]:
        """Value and standard error of ``function(model)``, a number or an array, to first order.

        >>> import freqid as fq
        >>> record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3).with_noise(0.01)
        >>> est = fq.fit(fq.first_order(), record)
        >>> gain, std = est.derived(lambda model: model["b"] / model["a"])
        >>> bool(abs(gain - 1) < 5 * std)
        True
        """
        if not isinstance(self.model, GreyBox):
            raise InputError("a function of parameters needs a grey-box estimate")
        model, at = with_unknowns(self.model, self.names)
        return derived(model, function, self.covariance_matrix[np.ix_(at, at)])

    def modes(self) -> pd.DataFrame:
        """Natural frequency (Hz) and damping ratio of each mode, with standard errors.

        ``in_band`` says whether what was fitted reaches a mode; one outside is what the parameters
        make of it, not what was seen.
        """
        # those of an estimate that was kept were written down
        known: pd.DataFrame | None = self.__dict__.get("known_modes")
        if known is not None:
            return known
        low, high = self.band or (0.0, 0.5 / self.dt if self.dt else np.inf)
        found = modes(*self._unknowns, once=not isinstance(self.model, GreyBox))
        from freqid.fitting.table import Table

        return Table(found.assign(in_band=found["frequency"].between(low, high)))

    def pole_scatter(self) -> tuple[ComplexArray, FloatArray]:
        """Poles (n,) in rad/s and the covariance of their real and imaginary parts, (n, 2, 2)."""
        return pole_scatter(*self._unknowns)

    def intervals(
        self,
        method: Literal["linear", "profile"] = "linear",
        level: float = 0.95,
        progress: bool = False,
        n_jobs: int | None = None,
    ) -> pd.DataFrame:
        """Confidence intervals, lower and upper, by standard errors or by ``"profile"`` likelihood.

        ``progress`` shows how many ends of profiles are found, by ``n_jobs`` processes, None being
        this one. Raises ValueError for an unknown method or a level outside (0, 1).
        """
        import pandas as pd

        choice("method", method, ("linear", "profile"))
        flag("progress", progress)
        if not 0 < finite("level", level) < 1:
            raise InputError(f"level={level!r} must lie between 0 and 1")
        if method == "profile":
            if not isinstance(self.model, GreyBox) or self.scatter.given is not None:
                raise InputError("profile intervals need a grey-box estimate from data")
            if self.problem is None:
                raise InputError(
                    "profile intervals need the data, which a file of an estimate does not hold; "
                    "fit them again"
                )
            std = np.sqrt(np.diag(self.covariance_matrix))
            jobs = processes(n_jobs)
            return profile_intervals(self.minimum, self.scatter.change, std, level, progress, jobs)
        half = quantile(self.told_by, level) * np.sqrt(np.diag(self.covariance_matrix))
        return pd.DataFrame(
            {"lower": self.values - half, "upper": self.values + half},
            index=pd.Index(list(self.names), name="parameter"),
        )
