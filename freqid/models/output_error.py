"""Black-box models: OutputError, a sampled rational model of any number of channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError, whole
from freqid.lti import Hold, PeriodicHold, StateSpace, as_hold
from freqid.models.model import MatrixModel

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class OutputError:
    """Black box: b(z)/a(z) of ``order``, in z = exp(jω·period) of the hold.

    With ``feedthrough`` the output answers to the input of the same sample (b₀ ≠ 0), as every
    plant does when its input is taken to run in straight lines between samples. Several inputs
    and outputs share one state space. With ``stable`` no motion grows: the poles stay inside of the
    unit circle. Raises ValueError for an order that is not a whole number.

    >>> OutputError(order=3)
    OutputError(order=3, feedthrough=False, stable=False)
    """

    order: int
    feedthrough: bool = False
    stable: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", whole("order", self.order))


@dataclass(frozen=True, eq=False)
class DiscreteModel(MatrixModel):
    """A sampled model x(k+1) = Φ x + Γ u, y = C x + D u at the period of its hold (s).

    ``stable`` says that it was asked for without a motion that grows.
    """

    delay = 0.0

    matrices: StateSpace
    dt: float
    hold: Hold
    input_names: Sequence[str]
    output_names: Sequence[str]
    stable: bool = False

    @property
    def own_hold(self) -> Hold:
        """The hold inside."""
        return self.hold

    @property
    def spec(self) -> OutputError:
        """The black box of which this is one: order, feedthrough, whether it has to be stable."""
        return OutputError(self.order, bool(self.matrices.D.any()), self.stable)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.matrices.A)

    @property
    def zeros(self) -> ComplexArray:
        """Transmission zeros in the z plane."""
        import control

        return np.asarray(control.zeros(self.to_control()))

    def denominator(self) -> FloatArray:
        """a(z), highest power first, (order + 1,)."""
        return characteristic(self.matrices.A)

    def numerator(self, output: int = 0, input: int = 0) -> FloatArray:
        """b(z) from one input to one output, highest power first, (order + 1,)."""
        return numerator_of(self.matrices, self.denominator(), output, input)

    def coefficients(self) -> tuple[list[str], FloatArray]:
        """Names and values of the coefficients: b of each channel pair, then a."""
        first = 0 if self.matrices.D.any() else 1
        names = self.coefficient_names(range(first, self.order + 1), range(1, self.order + 1))
        return names, coefficients_of(self.matrices)

    def to_continuous(self, hold: Hold | str | None = None) -> control.StateSpace:
        """The continuous plant that this hold samples to the model, a ``control.StateSpace``.

        Raises ValueError where there is none: a pole at zero or on the negative real axis has no
        real logarithm, and only a band-limited model that is strictly proper has one.
        """
        import control

        between = as_hold(self.hold if hold is None else hold, self.dt)
        if isinstance(between, PeriodicHold) and abs(between.period / self.dt - 1) > 1e-9:
            raise InputError(
                f"hold={between!r} must have the model's own period, {self.dt:g} s; "
                f"use {type(between).__name__}({self.dt:g})"
            )
        continuous = invert_hold(self.matrices, self.dt, between)
        return control.ss(
            *continuous, inputs=list(self.input_names), outputs=list(self.output_names)
        )

    def __repr__(self) -> str:
        p, m = self.matrices.D.shape
        return f"<DiscreteModel of order {self.order}, {p}x{m}, dt={self.dt:g} s, {self.hold!r}>"


def characteristic(A: FloatArray) -> FloatArray:
    """det(zI − A), highest power first, (…, n + 1), of matrices (…, n, n)."""
    roots = np.linalg.eigvals(A)
    a = np.zeros((*roots.shape[:-1], roots.shape[-1] + 1), complex)
    a[..., 0] = 1
    for k in range(roots.shape[-1]):
        a[..., 1 : k + 2] -= roots[..., k, None] * a[..., : k + 1]
    return a.real


def numerator_of(matrices: StateSpace, a: FloatArray, output: int, input: int) -> FloatArray:
    """b(z) of a channel pair beside the denominator a(z), (…, n + 1)."""
    A, B, C, D = matrices
    # det(zI − A + b c) = a(z) + c adj(zI − A) b is linear in b and c, which may be of size one
    b, c = B[..., :, input, None], C[..., output, None, :]
    size = np.linalg.norm(b, axis=-2, keepdims=True), np.linalg.norm(c, axis=-1, keepdims=True)
    sized = [np.where(s > 0, s, 1) for s in size]
    closed = characteristic(A - (b / sized[0]) * (c / sized[1])) - a
    return closed * (sized[0] * sized[1])[..., 0] + D[..., output, input, None] * a


def coefficients_of(matrices: StateSpace) -> FloatArray:
    """Coefficients of all channel pairs' b(z), then of a(z), in a row, (…, coefficients)."""
    a = characteristic(matrices.A)
    p, m = matrices.D.shape[-2:]
    first = 0 if matrices.D.any() else 1
    rows = [numerator_of(matrices, a, o, i)[..., first:] for o in range(p) for i in range(m)]
    return np.concatenate([*rows, a[..., 1:]], axis=-1)


def invert_hold(sampled: StateSpace, dt: float, hold: Hold) -> StateSpace:
    """The continuous plant whose sampled matrices under ``hold`` are these.

    A from the logarithm of Φ; under a periodic hold B from Γ + ΦΓ⁺, which is linear in B, and D
    from C Γ⁺. Band-limited: the plant whose impulse response, times dt, is the model's (impulse
    invariance).
    """
    Phi, Gamma, C, D = sampled
    poles = np.linalg.eigvals(Phi)
    bad = (np.abs(poles.imag) <= 1e-9 * np.abs(poles)) & (poles.real <= 1e-12)
    if bad.any():
        raise InputError(
            f"the model has a pole at z={poles[bad][0].real:.6g}, on the negative real axis or at "
            f"zero: no real continuous plant samples to it under {hold!r}; lower the order or "
            "sample faster"
        )
    A = _real_log(Phi) / dt
    if isinstance(hold, PeriodicHold):
        unit = hold.sampled(A, np.eye(len(A)))
        B = np.linalg.solve(unit.gamma + Phi @ unit.gamma_next, Gamma)
        return StateSpace(A, B, C, D - C @ unit.gamma_next @ B)
    B = np.linalg.solve(Phi, Gamma) / dt
    # the sampled impulse response counts half of its jump at zero (Poisson summation)
    return StateSpace(A, B, C, D - C @ B * dt / 2)


def _real_log(M: FloatArray) -> FloatArray:
    logarithm = scipy.linalg.logm(M)
    if np.abs(np.imag(logarithm)).max() > 1e-8 * max(np.abs(logarithm).max(), 1e-300):
        raise InputError("the model has no real logarithm: no real continuous plant samples to it")
    return np.real(logarithm)
