"""What the input did between its samples: holds, the plants that they sample, and derivatives.

A hold has a period of its own. Decimation changes the sample time of a record and leaves the
hold as it was; everything that this package adds to the paper follows from that.

In every formula below x' = A x + B u, and the sampled plant is written

    x(k+1) = Φ x(k) + Γ u(k) + Γ⁺ u(k+1),

where Γ⁺ is zero under a zero-order hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from freqid.checks import Array, ComplexArray, FloatArray, positive
from freqid.lti.holds.phi import phi_functions


class Sampled(NamedTuple):
    """Sampled matrices: Φ (n, n), Γ (n, m) and Γ⁺ (n, m); derivatives carry a leading axis."""

    phi: Array
    gamma: Array
    gamma_next: Any


class ModalSampled(NamedTuple):
    """What a hold makes of an eigenvalue λ of A, and the divided differences of that.

    φ = exp(λ h); γ and γ⁺ (None under a zero-order hold) multiply the rows of V⁻¹B. ``d…``
    (…, n, n) are the divided differences f[λi, λj], the factors of the Fréchet derivative in the
    eigenbasis (Higham, Functions of Matrices, 2008, theorem 3.11).
    """

    phi: ComplexArray
    gamma: ComplexArray
    gamma_next: Any
    dphi: ComplexArray
    dgamma: ComplexArray
    dgamma_next: Any


@dataclass(frozen=True)
class Hold:
    """Base of the holds: use ZeroOrderHold, FirstOrderHold or BandLimited."""

    @property
    def name(self) -> str:
        """Short name, as in ``hold="zoh"``."""
        raise NotImplementedError


@dataclass(frozen=True)
class PeriodicHold(Hold):
    """A hold that repeats every ``period`` seconds."""

    period: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", positive("period", self.period, "s"))

    def sampled(self, A: FloatArray, B: FloatArray) -> Sampled:
        """Sampled matrices of x' = A x + B u under this hold.

        Args: A (n, n), B (n, m). Returns ``Sampled``. Raises ValueError on shapes that disagree.

        >>> ZeroOrderHold(0.1).sampled(np.array([[-1.0]]), np.array([[1.0]])).phi.round(6)
        array([[0.904837]])
        """
        A, B = _checked(A, B)
        n, m = B.shape
        return self._blocks(scipy.linalg.expm(self._generator(A, B)), n, m)

    def sampled_derivatives(
        self, A: FloatArray, B: FloatArray, dA: FloatArray, dB: FloatArray
    ) -> tuple[Sampled, Sampled]:
        """Sampled matrices and their exact derivatives along each direction (dA[p], dB[p]).

        Args: A (n, n), B (n, m), dA (P, n, n), dB (P, n, m). The derivative is the top right block
        of exp([[X, dX], [0, X]]) (Van Loan, IEEE Trans. Automatic Control 23, 1978), which needs
        no eigenvectors and so holds for defective plants.
        """
        A, B = _checked(A, B)
        n, m = B.shape
        X = self._generator(A, B)
        count, size = len(dA), len(X)
        big = np.zeros((count, 2 * size, 2 * size))
        big[:, :size, :size] = X
        big[:, size:, size:] = X
        big[:, :n, size : size + n] = dA * self.period
        big[:, :n, size + n : size + n + m] = dB * self.period
        if count == 0:
            return self.sampled(A, B), Sampled(dA, dB, dB)
        exponential = scipy.linalg.expm(big)
        value = self._blocks(exponential[0, :size, :size], n, m)
        return value, self._blocks(exponential[:, :size, size:], n, m)

    def modal(self, eigenvalues: ComplexArray) -> ModalSampled:
        """φ, γ, γ⁺ and their divided differences at the eigenvalues of A, (…, n) in rad/s."""
        h = self.period
        value, difference = phi_functions(eigenvalues * h)
        gamma, gamma_next = self._weights(value)
        dgamma, dgamma_next = self._weights(difference)
        return ModalSampled(
            value[0],
            h * gamma,
            None if gamma_next is None else h * gamma_next,
            h * difference[0],
            h**2 * dgamma,
            None if dgamma_next is None else h**2 * dgamma_next,
        )

    def _generator(self, A: FloatArray, B: FloatArray) -> FloatArray:
        raise NotImplementedError

    def _blocks(self, exponential: FloatArray, n: int, m: int) -> Sampled:
        raise NotImplementedError

    def _weights(self, phi: tuple[ComplexArray, ...]) -> tuple[ComplexArray, Any]:
        raise NotImplementedError


@dataclass(frozen=True)
class ZeroOrderHold(PeriodicHold):
    """The input keeps its value for ``period`` seconds: what a digital-to-analogue converter does.

    Response C (zI − Φ)⁻¹ Γ + D with z = exp(jω·period), whatever the record's sample time.

    >>> ZeroOrderHold(0.5e-3)
    ZeroOrderHold(period=0.0005)
    """

    @property
    def name(self) -> str:
        """``"zoh"``."""
        return "zoh"

    def _generator(self, A: FloatArray, B: FloatArray) -> FloatArray:
        n, m = B.shape
        X = np.zeros((n + m, n + m))
        X[:n, :n], X[:n, n:] = A * self.period, B * self.period
        return X

    def _blocks(self, exponential: FloatArray, n: int, m: int) -> Sampled:
        gamma = exponential[..., :n, n : n + m]
        return Sampled(exponential[..., :n, :n], gamma, np.zeros_like(gamma))

    def _weights(self, phi: tuple[ComplexArray, ...]) -> tuple[ComplexArray, Any]:
        return phi[1], None


@dataclass(frozen=True)
class FirstOrderHold(PeriodicHold):
    """The input runs in straight lines between samples ``period`` seconds apart (triangle hold).

    Response C (zI − Φ)⁻¹ (Γ1 − Γ2 + z Γ2) + D (Franklin, Powell and Workman, Digital Control of
    Dynamic Systems, 1998, section 6.3.2): Γ = Γ1 − Γ2 and Γ⁺ = Γ2 here.
    """

    @property
    def name(self) -> str:
        """``"foh"``."""
        return "foh"

    def _generator(self, A: FloatArray, B: FloatArray) -> FloatArray:
        n, m = B.shape
        X = np.zeros((n + 2 * m, n + 2 * m))
        X[:n, :n], X[:n, n : n + m] = A * self.period, B * self.period
        X[n : n + m, n + m :] = np.eye(m)
        return X

    def _blocks(self, exponential: FloatArray, n: int, m: int) -> Sampled:
        ramp = exponential[..., :n, n + m : n + 2 * m]
        return Sampled(exponential[..., :n, :n], exponential[..., :n, n : n + m] - ramp, ramp)

    def _weights(self, phi: tuple[ComplexArray, ...]) -> tuple[ComplexArray, Any]:
        return phi[1] - phi[2], phi[2]


@dataclass(frozen=True)
class BandLimited(Hold):
    """The input has no energy above the Nyquist limit: response C (jωI − A)⁻¹ B + D."""

    @property
    def name(self) -> str:
        """``"bl"``."""
        return "bl"


def _checked(A: FloatArray, B: FloatArray) -> tuple[FloatArray, FloatArray]:
    A, B = np.asarray(A, dtype=float), np.asarray(B, dtype=float)
    if A.ndim != 2 or A.shape[0] != A.shape[1] or B.ndim != 2 or B.shape[0] != A.shape[0]:
        raise ValueError(
            f"A has shape {A.shape} and B has shape {B.shape}; expected (n, n) and (n, inputs)"
        )
    return A, B


def as_hold(hold: Hold | str | None, dt: float, remembered: Hold | None = None) -> Hold:
    """The hold an argument means: a Hold itself, a name at ``dt`` (s), None the remembered one.

    Raises ValueError for anything else.

    >>> as_hold("foh", 0.005)
    FirstOrderHold(period=0.005)
    """
    if isinstance(hold, Hold):
        return hold
    if hold is None and remembered is not None:
        return remembered
    if hold == "zoh":
        return ZeroOrderHold(dt)
    if hold == "foh":
        return FirstOrderHold(dt)
    if hold == "bl":
        return BandLimited()
    raise ValueError(
        f"hold={hold!r} is not a hold; expected 'zoh', 'foh', 'bl' (at the record's sample time), "
        "ZeroOrderHold(period), FirstOrderHold(period), BandLimited() or None"
    )
