"""GreyBox: a continuous-time plant whose matrices are functions of physical parameters."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import (
    FloatArray,
    InputError,
    State,
    channel_names,
    listed,
    named_values,
    unknown,
)
from freqid.data import as_conditions
from freqid.lti import Linearisation, StateSpace
from freqid.models.delays import delay_names, given_delays
from freqid.models.matrices import Jacobian, Matrices, MatrixFunction, without
from freqid.models.model import Model
from freqid.models.parameter import Parameter
from freqid.models.portable import arrived, carried
from freqid.models.ties import Ties


@dataclass(frozen=True)
class GreyBox(Model):
    """A continuous-time plant whose matrices are functions of physical parameters.

    Args:
        matrices: ``matrices(**values)`` returns A (n, n), B (n, inputs), C (outputs, n),
            D (outputs, inputs); a D of None or 0 is all zeros.
        parameters: the Parameter objects, in the order in which results list them.
        outputs, inputs: names of the channels.
        name: shown in reports.
        ties: expressions of other parameters by name, ``{"Ja": "2 * Jm"}``: a parameter that is
            tied takes the expression's value and is not estimated.
        jacobian: ``jacobian(**values)`` returns for each parameter's name the derivatives
            (dA, dB, dC, dD) of the matrices; complex steps or differences are taken without it.
        vectorized: True says that ``matrices`` also takes arrays of values, (batch,), and then
            returns matrices with that leading axis. It only saves time.
        input_delay: by how much the inputs come late: in s, the name of a parameter (in s, which
            ``matrices`` need not take), or one of these for each input.
        conditions: what ``matrices`` is told beside the parameters, a posture or a load, with the
            values used where a record does not say them (``record.with_conditions``).

    Raises ValueError when the matrices do not have agreeing shapes or are not finite, or when two
    parameters share a name.

    >>> lag = GreyBox(lambda tau: ([[-1 / tau]], [[1 / tau]], [[1.0]], None),
    ...               parameters=[Parameter("tau", 0.01, unit="s")])
    >>> lag.with_values(tau=0.02).values
    {'tau': 0.02}
    """

    dt = 0.0

    matrices: Matrices
    parameters: Sequence[Parameter]
    outputs: Sequence[str] | None = None
    inputs: Sequence[str] | None = None
    name: str = "grey box"
    vectorized: bool = False
    ties: Mapping[str, str] = field(default_factory=dict)
    jacobian: Jacobian | None = None
    input_delay: float | str | Sequence[float | str] | None = None
    conditions: Mapping[str, float] = field(default_factory=dict)
    _function: MatrixFunction = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        parameters = tuple(listed("parameters", self.parameters))
        object.__setattr__(self, "parameters", parameters)
        for p in parameters:
            if not isinstance(p, Parameter):
                raise InputError(f"parameters holds {p!r}; expected Parameter objects")
        names = [p.name for p in parameters]
        if len(set(names)) < len(names):
            raise InputError(f"parameters={names} has a name twice; names must differ")
        conditions = as_conditions(self.conditions)
        object.__setattr__(self, "conditions", conditions)
        if both := set(names) & set(conditions):
            raise InputError(
                f"conditions: {sorted(both)[0]!r} is a parameter; a record makes a parameter known "
                "by a condition of its name, so leave it out here"
            )
        ties = Ties(named_values("ties", self.ties), names)
        nominal = ties.resolve({p.name: p.value for p in parameters})
        timing = delay_names(given_delays(self.input_delay), names, self.ties)
        function = MatrixFunction(
            without(self.matrices, timing),
            ties,
            self.vectorized,
            None if self.jacobian is None else without(self.jacobian, timing),  # type: ignore[arg-type]
            nominal,
            conditions,
        )
        object.__setattr__(self, "_function", function)
        at = self.state_space()
        given = given_delays(self.input_delay)
        if len(given) not in (0, 1, at.B.shape[1]):
            raise InputError(
                f"input_delay has {len(given)} entries for {at.B.shape[1]} inputs; give one, or "
                "one for each"
            )
        object.__setattr__(
            self, "outputs", channel_names("outputs", self.outputs, at.C.shape[0], "y")
        )
        object.__setattr__(self, "inputs", channel_names("inputs", self.inputs, at.B.shape[1], "u"))

    def __getstate__(self) -> State:
        """What a pickle takes: functions that no module holds by their code."""
        return carried(self.__dict__, "matrices", "jacobian")

    def __setstate__(self, state: State) -> None:
        """Restore; what version 0.1.0 wrote lacks what it did not know."""
        self.__dict__.update({"conditions": {}} | arrived(state))

    @property
    def delay_sources(self) -> tuple[float | str, ...]:
        """What tells the delay of each input: seconds, or a parameter's name; empty for none."""
        given = given_delays(self.input_delay)
        return given * self.n_inputs if len(given) == 1 else given

    @property
    def delays(self) -> tuple[float, ...]:
        """Delay of each input in s."""
        values, sources = self.values, self.delay_sources or (0.0,) * self.n_inputs
        return tuple(values[d] if isinstance(d, str) else float(d) for d in sources)

    @property
    def delay(self) -> float:  # type: ignore[override]
        """The longest delay of an input in s."""
        return max(self.delays, key=abs, default=0.0)

    @property
    def values(self) -> dict[str, float]:
        """Value of every parameter by name, tied ones resolved."""
        return self._function.ties.resolve({p.name: p.value for p in self.parameters})

    @property
    def free_parameters(self) -> tuple[Parameter, ...]:
        """The parameters that a fit moves: neither fixed nor tied."""
        return tuple(p for p in self.parameters if not p.fixed and p.name not in self.ties)

    def __getitem__(self, name: str) -> float:
        self.parameter(name)
        return self.values[name]

    def parameter(self, name: str) -> Parameter:
        """The Parameter called ``name``; ValueError if there is none."""
        for p in self.parameters:
            if isinstance(name, str) and p.name == name:
                return p
        raise InputError(unknown("parameter", name, self.values))

    def with_values(self, **values: float) -> GreyBox:
        """The same plant at other parameter values. Raises ValueError for an unknown name.

        >>> from freqid import two_mass
        >>> two_mass().with_values(k=2e5)["k"]
        200000.0
        """
        return self._changed({name: {"value": value} for name, value in values.items()})

    def with_conditions(self, **conditions: float) -> GreyBox:
        """The same plant at other conditions, and other values of parameters that are among them.

        Raises ValueError for a name that is neither.

        >>> import freqid as fq
        >>> arm = fq.GreyBox(lambda k, q: ([[-k * q]], [[1.0]], [[1.0]], None),
        ...                  [fq.Parameter("k", 2.0)], conditions={"q": 1.0})
        >>> arm.with_conditions(q=3.0).poles.real
        array([-6.])
        """
        for name in conditions:
            if name not in self.conditions and name not in self.values:
                raise InputError(unknown("conditions", name, [*self.conditions, *self.values]))
        known = {n: v for n, v in conditions.items() if n in self.values}
        other = copy.copy(self.with_values(**known) if known else self)
        own = {n: v for n, v in conditions.items() if n in self.conditions}
        new = {**self.conditions, **as_conditions(own)}
        object.__setattr__(other, "conditions", new)
        object.__setattr__(other, "_function", self._function.under(new))
        return other

    def met_at(self, conditions: Mapping[str, float]) -> GreyBox:
        """The plant as an experiment under these conditions meets it."""
        given = named_values("conditions", conditions)
        return self.with_conditions(**given) if given else self

    def fix(self, *names: str) -> GreyBox:
        """The same plant with these parameters held at their values in a fit."""
        return self._changed({self.parameter(n).name: {"fixed": True} for n in names})

    def free(self, *names: str) -> GreyBox:
        """The same plant with these parameters estimated in a fit."""
        return self._changed({self.parameter(n).name: {"fixed": False} for n in names})

    def with_bounds(self, **bounds: tuple[float, float]) -> GreyBox:
        """The same plant with other search bounds, ``with_bounds(k=(1e4, 1e6))``."""
        for name, pair in bounds.items():
            if not isinstance(pair, (tuple, list, np.ndarray)) or len(pair) != 2:
                raise InputError(f"bounds of {name}={pair!r:.80} must be (lower, upper)")
        return self._changed({n: {"lower": lo, "upper": hi} for n, (lo, hi) in bounds.items()})

    def with_prior(self, **priors: tuple[float, float] | None) -> GreyBox:
        """The same plant with priors (mean, standard deviation), ``with_prior(k=(1.5e5, 1e4))``."""
        return self._changed({n: {"prior": prior} for n, prior in priors.items()})

    def tie(self, **expressions: str) -> GreyBox:
        """The same plant with parameters tied to expressions of others, ``tie(Ja="2 * Jm")``.

        Raises ValueError for an unknown name, an expression that cannot be computed, or a tie to a
        tied parameter.

        >>> from freqid import two_mass
        >>> two_mass().tie(Ja="1e4 * Jm")["Ja"]
        9.0
        """
        for name in expressions:
            self.parameter(name)
        return dataclasses.replace(self, ties={**self.ties, **expressions})

    def _changed(self, changes: Mapping[str, Mapping[str, Any]]) -> GreyBox:
        for name in changes:
            self.parameter(name)
        for name in self.ties:
            if "value" in changes.get(name, {}) and changes[name]["value"] != self.values[name]:
                raise InputError(
                    f"parameter {name} is tied to {self.ties[name]!r}; set the parameters it is of"
                )
        new = tuple(
            p.changed(**changes[p.name]) if p.name in changes else p for p in self.parameters
        )
        # shapes and names are as they were checked already
        other = copy.copy(self)
        object.__setattr__(other, "parameters", new)
        return other

    def state_space(self, **values: float) -> StateSpace:
        """A, B, C, D at the parameter values, or at ``values`` where given.

        >>> from freqid import first_order
        >>> first_order(b=3, a=2).state_space().A
        array([[-2.]])
        """
        return self._function.at(self.values | values)

    def state_spaces(self, **columns: ArrayLike) -> StateSpace:
        """The same at many points: of values (S,) each, matrices (S, …)."""
        rows = np.transpose([*columns.values()])
        each = [self.state_space(**dict(zip(columns, row, strict=True))) for row in rows]
        return StateSpace(*map(np.stack, zip(*each, strict=True)))

    def linearisation(self) -> Linearisation:
        """The matrices, and their derivatives by the free parameters."""
        return self.linearise(self.values, [p.name for p in self.free_parameters])

    def linearise(self, values: Mapping[str, float], names: Sequence[str]) -> Linearisation:
        """Matrices at ``values`` and their derivatives by the parameters ``names``.

        A complex step (Squire and Trapp, SIAM Review 40, 1998) gives the derivative to rounding;
        where the user's function does not carry complex numbers through, central differences.
        """
        return self._function.linearise(values, names)

    def linearise_many(self, points: FloatArray, names: Sequence[str]) -> Linearisation:
        """Matrices (S, …) at many points (S, len(names)) and their derivatives (S, P, …)."""
        return self._function.linearise_many(self.values, points, names)

    def __repr__(self) -> str:
        inside = ", ".join(
            f"{p.name}={v:g}{' fixed' * p.fixed}{' tied' * (p.name in self.ties)}"
            for p, v in zip(self.parameters, self.values.values(), strict=True)
        )
        late = f", inputs late by {self.input_delay}" if self.delay_sources else ""
        return f"<GreyBox {self.name}: {inside}{late}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(p.name)}</td><td>{p.value:g}</td><td>{escape(p.unit)}</td>"
            f"<td>{'fixed' if p.fixed else 'free'}</td></tr>"
            for p in self.parameters
        )
        return (
            f"<table><caption>{escape(self.name)}</caption>"
            f"<tr><th>parameter</th><th>value</th><th>unit</th><th></th></tr>{rows}</table>"
        )
