"""Anything that stands for a linear model, as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from freqid.checks import InputError
from freqid.lti import StateSpace, ZeroOrderHold
from freqid.models.model import MatrixModel, Model
from freqid.models.output_error import DiscreteModel

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class SystemModel(MatrixModel):
    """A continuous-time control system; its inputs come late by ``input_delays`` in s, if any."""

    dt = 0.0
    delay = 0.0

    matrices: StateSpace
    input_names: Sequence[str]
    output_names: Sequence[str]
    input_delays: Sequence[float] = ()

    @property
    def delays(self) -> tuple[float, ...]:
        """Delay of each input in s."""
        return tuple(self.input_delays) or super().delays


class HasModel(Protocol):
    """An estimate: what has a model inside."""

    @property
    def model(self) -> Model:
        """The model at the estimate."""
        ...


ModelLike: TypeAlias = "Model | HasModel | control.lti.LTI"


def as_model(thing: ModelLike) -> Model:
    """The model that a model, an estimate or a control system stands for.

    Raises ValueError for anything else. A discrete control system whose sample time is not said
    has one of 1 s.

    >>> import control
    >>> as_model(control.tf([1], [1, 2])).poles
    array([-2.+0.j])
    """
    inner = getattr(thing, "model", thing)
    if isinstance(inner, Model):
        return inner
    import control

    if not isinstance(inner, control.lti.LTI) or isinstance(inner, control.FrequencyResponseData):
        raise InputError(
            f"model={type(inner).__name__} is not a model, an estimate or a control system; "
            "a FrequencyResponse is fitted or drawn as it is"
        )
    try:
        system = (
            _joined(inner) if isinstance(inner, control.TransferFunction) else control.ss(inner)
        )
    except Exception as error:  # control raises what its parts raise
        raise InputError(f"model={type(inner).__name__} has no state space: {error}") from error
    at = StateSpace(*(np.asarray(M, dtype=float) for M in (system.A, system.B, system.C, system.D)))
    names = system.input_labels, system.output_labels
    if not system.dt:
        return SystemModel(at, *names)
    dt = 1.0 if system.dt is True else float(system.dt)
    return DiscreteModel(at, dt, ZeroOrderHold(dt), *names)


def _joined(quotients: control.TransferFunction) -> control.StateSpace:
    """Quotients of all pairs of channels side by side; control joins them only with slycot."""
    import control

    p, m = quotients.noutputs, quotients.ninputs
    if p == m == 1:
        return control.ss(quotients)
    apart = control.append(*(control.ss(quotients[o, i]) for o in range(p) for i in range(m)))
    spread, sums = np.kron(np.ones((p, 1)), np.eye(m)), np.kron(np.eye(p), np.ones((1, m)))
    at = apart.A, apart.B @ spread, sums @ apart.C, sums @ apart.D @ spread
    names = {"inputs": quotients.input_labels, "outputs": quotients.output_labels}
    return control.ss(*at, quotients.dt, **names)
