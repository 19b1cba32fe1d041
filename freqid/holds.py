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


class Sampled(NamedTuple):
    """Sampled matrices: Φ (n, n), Γ (n, m) and Γ⁺ (n, m); derivatives carry a leading axis."""

    phi: Array
    gamma: Array
    gamma_next: Any


class ModalSampled(NamedTuple):
    """What a hold makes of an eigenvalue λ of A, and the divided differences of that.

    φ = exp(λ h); γ and γ⁺ multiply the rows of V⁻¹B. ``d…`` (…, n, n) are the divided differences
    f[λi, λj], the factors of the Fréchet derivative in the eigenbasis (Higham, Functions of
    Matrices, 2008, theorem 3.11).
    """

    phi: ComplexArray
    gamma: ComplexArray
    gamma_next: ComplexArray
    dphi: ComplexArray
    dgamma: ComplexArray
    dgamma_next: ComplexArray


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
        value, difference = phi_functions(eigenvalues * h, second=self.name == "foh")
        gamma, gamma_next = self._weights(value)
        dgamma, dgamma_next = self._weights(difference)
        return ModalSampled(
            value[0],
            h * gamma,
            h * gamma_next,
            h * difference[0],
            h**2 * dgamma,
            h**2 * dgamma_next,
        )

    def _generator(self, A: FloatArray, B: FloatArray) -> FloatArray:
        raise NotImplementedError

    def _blocks(self, exponential: FloatArray, n: int, m: int) -> Sampled:
        raise NotImplementedError

    def _weights(self, phi: tuple[ComplexArray, ...]) -> tuple[ComplexArray, ComplexArray]:
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

    def _weights(self, phi: tuple[ComplexArray, ...]) -> tuple[ComplexArray, ComplexArray]:
        return phi[1], np.zeros_like(phi[1])


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

    def _weights(self, phi: tuple[ComplexArray, ...]) -> tuple[ComplexArray, ComplexArray]:
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


# eight Gauss-Legendre nodes integrate exp(xs) on [0, 1] to rounding for |x| <= 1
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2


def phi_functions(
    x: ComplexArray, second: bool = True
) -> tuple[tuple[ComplexArray, ...], tuple[ComplexArray, ...]]:
    """φ0 = e^x, φ1 = ∫e^{xs}ds, φ2 = ∫(1−s)e^{xs}ds over [0, 1], and their divided differences.

    Args: x (…, n), complex; ``second`` says whether φ2 is wanted. Returns three (…, n) arrays and
    three (…, n, n) arrays. Where an argument is of size 1 or more the recurrences x φ1 = φ0 − 1,
    x φ2 = φ1 − 1 (and their divided differences) are stable; nearer zero they cancel, and the
    integrals are summed instead.

    >>> value, difference = phi_functions(np.array([0.0, 1.0]))
    >>> bool(np.isclose(difference[0][0, 1], np.e - 1)), bool(np.isclose(difference[1][0, 0], 0.5))
    (True, True)
    """
    x = np.asarray(x, dtype=complex)
    size = np.abs(x)
    a, b = x[..., :, None], x[..., None, :]
    half, middle = (a - b) / 2, (a + b) / 2
    phi0 = np.exp(x)
    if np.abs(x.real).max(initial=0) < 300:
        d0 = np.exp(middle) * _sinhc(half)
    else:
        close = np.abs(half) < 0.5
        near = np.exp(np.where(close, middle, 0)) * _sinhc(np.where(close, half, 0))
        gap = np.where(close, 1, 2 * half)
        d0 = np.where(close, near, (phi0[..., :, None] - phi0[..., None, :]) / gap)
    small = size < 1
    if small.all():
        value = _summed(x, second)
        difference = _summed_differences(half, middle, second)
    else:
        value, difference = _recurred(x, phi0, d0, size, second)
        if small.any():
            inside = _summed(np.where(small, x, 0), second)
            value = tuple(np.where(small, i, v) for i, v in zip(inside, value, strict=True))
            value, difference = _recurred(x, phi0, d0, size, second, value)
            both = small[..., :, None] & small[..., None, :]
            inside = _summed_differences(np.where(both, half, 0), np.where(both, middle, 0), second)
            difference = tuple(
                np.where(both, i, d) for i, d in zip(inside, difference, strict=True)
            )
    return (phi0, *value), (d0, *difference)


def _summed(x: ComplexArray, second: bool) -> tuple[ComplexArray, ...]:
    """φ1 and φ2 by Gauss-Legendre sums, for |x| < 1."""
    near = np.exp(x[..., None] * _NODES)
    return near @ _WEIGHTS, near @ (_WEIGHTS * (1 - _NODES)) if second else x


def _summed_differences(
    half: ComplexArray, middle: ComplexArray, second: bool
) -> tuple[ComplexArray, ...]:
    """φ1[a, b] = ∫ s e^{s(a+b)/2} sinhc(s(a−b)/2) ds, and the same with s(1−s) for φ2."""
    kernel = np.exp(middle[..., None] * _NODES) * _sinhc(half[..., None] * _NODES)
    first = kernel @ (_WEIGHTS * _NODES)
    return first, kernel @ (_WEIGHTS * _NODES * (1 - _NODES)) if second else first


def _recurred(
    x: ComplexArray,
    phi0: ComplexArray,
    d0: ComplexArray,
    size: FloatArray,
    second: bool,
    value: tuple[ComplexArray, ...] | None = None,
) -> tuple[tuple[ComplexArray, ...], tuple[ComplexArray, ...]]:
    """φ1, φ2 and differences by recurrence; y f[x, y] = g[x, y] − f(x) with y the larger."""
    if value is None:
        safe = np.where(size < 1, 1, x)
        phi1 = (phi0 - 1) / safe
        value = phi1, (phi1 - 1) / safe if second else phi1
    swap = size[..., :, None] > size[..., None, :]
    larger = np.where(swap, x[..., :, None], x[..., None, :])
    larger = np.where(np.abs(larger) < 1, 1, larger)
    differences, previous = [], d0
    for f in value if second else value[:1]:
        previous = (previous - np.where(swap, f[..., None, :], f[..., :, None])) / larger
        differences.append(previous)
    return value, (*differences,) if second else (differences[0], differences[0])


def _sinhc(x: ComplexArray) -> ComplexArray:
    """sinh(x)/x, 1 at zero."""
    # added where x vanishes, and below rounding anywhere else
    x = x + 1e-30
    return np.sinh(x) / x


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
