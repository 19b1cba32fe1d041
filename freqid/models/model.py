"""What every model can do, whatever it is made of: matrices, response, poles, control system."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import ComplexArray, FloatArray, InputError, increasing, numbers, whole
from freqid.data import FrequencyResponse
from freqid.lti import (
    BandLimited,
    Hold,
    InputHolds,
    Linearisation,
    PeriodicHold,
    Realisation,
    Sampled,
    StateSpace,
    Timing,
    basis_of,
    on_circle,
    points,
    transfer,
    warn_of_rounding,
)

if TYPE_CHECKING:
    import control


class Model(ABC):
    """A linear model: grey box, rational function or plain matrices.

    ``dt`` is the sample time in s of a sampled model, 0 in continuous time; ``delay`` that of all
    inputs in s; ``inputs`` and ``outputs`` are the names of the channels.
    """

    dt: float
    delay: float
    inputs: Sequence[str] | None
    outputs: Sequence[str] | None

    @abstractmethod
    def state_space(self) -> StateSpace:
        """A (n, n), B (n, inputs), C (outputs, n), D (outputs, inputs)."""

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return len(self.inputs or ())

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return len(self.outputs or ())

    @property
    def delays(self) -> tuple[float, ...]:
        """Delay of each input in s."""
        return (self.delay,) * self.n_inputs

    @property
    def late(self) -> bool:
        """Whether any input comes late."""
        return any(self.delays)

    @property
    def poles(self) -> ComplexArray:
        """Poles, (n,): in rad/s, or in the z plane where the model is a sampled one."""
        return np.linalg.eigvals(self.state_space().A).astype(complex)

    def met_at(self, conditions: Mapping[str, float]) -> Model:
        """The model as an experiment under these conditions meets it."""
        return self

    @property
    def own_hold(self) -> Hold | None:
        """The hold that a sampled model has inside, None in continuous time."""
        return None

    @property
    def integrates(self) -> bool:
        """Whether there is a pole at zero frequency, up to rounding."""
        A = self.state_space().A
        if not A.size:
            return False
        # rounding splits a double pole by the root of its size, and leaves the matrix singular
        scaled = scipy.linalg.lapack.dgebal(
            A - np.eye(len(A)) if self.dt else A, scale=1, permute=1
        )[0]
        s = np.linalg.svd(scaled, compute_uv=False)
        return bool(s[-1] <= 1e-13 * max(s[0], 1e-300))

    def linearisation(self) -> Linearisation:
        """The matrices, and their derivatives by the parameters that a fit moves."""
        at = self.state_space()
        return Linearisation(at, at.still())

    def still(self) -> Realisation:
        """The model at its values, for what moves none of them."""
        at = self.state_space()
        delay = tuple(map(Timing, self.delays)) if self.late else None
        return Realisation.of(Linearisation(at, at.still()), delay=delay)

    def sampled(self, hold: Hold) -> Sampled:
        """Matrices of x(k+1) = Φ x + Γ u(k) + Γ⁺ u(k+1) under a hold; a sampled model has its own.

        >>> from freqid import ZeroOrderHold, first_order
        >>> first_order().sampled(ZeroOrderHold(1e-3)).phi.round(6)
        array([[0.904837]])
        """
        at = self.state_space()
        if self.dt or not isinstance(hold, PeriodicHold):
            return Sampled(at.A, at.B, 0 * at.B)
        return hold.sampled(at.A, at.B)

    def frequency_response(
        self, omega: ArrayLike, hold: Hold | str | None = None
    ) -> FrequencyResponse:
        """Frequency response at ``omega`` (rad/s); of the continuous plant, or through a hold.

        That of a sampled model is taken at exp(jω·dt): it has its hold inside. Returns a
        FrequencyResponse, (outputs, inputs, frequencies). Raises ValueError for omega that is
        negative, not finite or not increasing, or a hold that is not one. Warns (RuntimeWarning)
        where rounding of the matrices is visible in nine digits.

        >>> import freqid as fq
        >>> abs(fq.first_order().frequency_response([100.0]).response[0, 0, 0]).round(4)
        np.float64(0.7071)
        """
        at = increasing("omega", np.atleast_1d(numbers("omega", omega)), "rad/s")
        if isinstance(hold, str) and hold == "bl":
            hold = BandLimited()
        if hold is not None and not isinstance(hold, Hold):
            raise InputError(
                f"hold={hold!r} is not a hold; a model has no sample time of its own, so give "
                "ZeroOrderHold(period), FirstOrderHold(period), BandLimited() or None"
            )
        with np.errstate(divide="ignore", invalid="ignore"):
            G = self.responses_at(at, hold)
        on = at[~np.isfinite(G).all(axis=(0, 1))]
        if len(on):
            raise InputError(
                f"omega={on[0]:g} rad/s lies on a pole of the model, where its response is not "
                "finite, as that of an integrator at zero; leave it out"
            )
        if not self.dt:
            warn_of_rounding(self.state_space(), hold or BandLimited(), at)
        hold = self.own_hold or hold
        each = InputHolds.each(hold, 1) if hold is not None else ()
        periods = [h.period for h in each if isinstance(h, PeriodicHold)]
        return FrequencyResponse(
            at / (2 * np.pi), G, dt=self.dt or max(periods, default=0.0), hold=hold,
            input_names=self.inputs, output_names=self.outputs,
        )  # fmt: skip

    def responses_at(self, omega: FloatArray, hold: Hold | None = None) -> ComplexArray:
        """The same as numbers (outputs, inputs, K), at frequencies in any order, negative ones too.

        Aliases of a line are such: an output slower than its input has several at each.
        """
        omega = numbers("omega", omega)
        if isinstance(hold, InputHolds):
            if len(hold.holds) != self.n_inputs:
                raise InputError(f"hold has {len(hold.holds)} entries for {self.n_inputs} inputs")
            parts = {h: self.responses_at(omega, h) for h, _ in hold.groups}
            return np.stack([parts[h][:, i] for i, h in enumerate(hold.holds)], axis=1)
        between = BandLimited() if hold is None or self.dt else hold
        z = on_circle(omega * self.dt) if self.dt else points(omega, between)
        if self.late:
            plant, late, _ = self.still().delayed(between, omega, z)
            return transfer(plant, z) * late
        return transfer(basis_of(self.state_space()).through(between), z)

    def to_control(self, pade: int | None = None) -> control.StateSpace:
        """The model as a ``control.StateSpace``, continuous or discrete as it is.

        A delay becomes Padé's approximation of order ``pade``. Raises ValueError for a model with
        a delay where no order is given: control systems have none.
        """
        import control

        names = {"inputs": list(self.inputs or ()), "outputs": list(self.outputs or ())}
        plain = control.ss(*self.state_space(), self.dt, **names)
        if not self.late:
            return plain
        worst = max(self.delays, key=abs)
        if pade is None:
            raise InputError(
                f"control systems have no delay and this model has {worst:g} s; give "
                "to_control(pade=order), or sample it: simulate knows the delay"
            )
        whole("pade", pade)
        if min(self.delays) < 0:
            raise InputError(f"delay={min(self.delays):g} s is early, which no system can be")
        late = control.append(*(_pade(delay, pade) for delay in self.delays))
        at = control.series(late, plain)
        return control.ss(at.A, at.B, at.C, at.D, self.dt, **names)


def _pade(delay: float, order: int) -> control.StateSpace:
    import control

    if delay == 0:
        return control.ss([], [], [], [[1.0]])
    return control.ss(control.tf(*control.pade(delay, order)))


class MatrixModel(Model):
    """A model that holds its matrices, (outputs, inputs) with names."""

    matrices: StateSpace
    input_names: Sequence[str]
    output_names: Sequence[str]

    def state_space(self) -> StateSpace:
        """A, B, C, D."""
        return self.matrices

    @property
    def inputs(self) -> Sequence[str]:  # type: ignore[override]
        """Names of the inputs."""
        return self.input_names

    @property
    def outputs(self) -> Sequence[str]:  # type: ignore[override]
        """Names of the outputs."""
        return self.output_names

    def coefficient_names(self, b: Iterable[int], a: Iterable[int]) -> list[str]:
        """Names of coefficients with these numbers: b of each channel pair in turn, then a."""
        pairs = [f"[{y},{u}]" for y in self.output_names for u in self.input_names]
        numbers = list(b)
        above = [f"b{k}{pair if len(pairs) > 1 else ''}" for pair in pairs for k in numbers]
        return [*above, *(f"a{k}" for k in a)]
