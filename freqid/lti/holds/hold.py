"""What the input did between its samples: holds, the plants that they sample, and derivatives.

A hold has a period of its own. Decimation changes the sample time of a record and leaves the
hold as it was; everything that this package adds to the paper follows from that.

In every formula below x' = A x + B u, and the sampled plant is written

    x(k+1) = Φ x(k) + Γ u(k) + Γ⁺ u(k+1),

where Γ⁺ is zero under a zero-order hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy

from freqid.checks import Array, ComplexArray, FloatArray, InputError, numbers, positive
from freqid.lti.double_double import Doubled
from freqid.lti.doubles import doubled_where_needed
from freqid.lti.exponential import doubled_exponential, exponential
from freqid.lti.holds.pulse import Pulse
from freqid.lti.holds.units import Units, near_one

# A times the period, from which on an exponential in doubles errs in the thirteenth digit
_LARGE = 300.0


class Sampled(NamedTuple):
    """Sampled matrices: Φ (n, n), Γ (n, m) and Γ⁺ (n, m); derivatives carry a leading axis."""

    phi: Array
    gamma: Array
    gamma_next: Any


class ModalSampled(NamedTuple):
    """What a hold makes of an eigenvalue λ of A, and the divided differences of that.

    φ = exp(λ h); γ and γ⁺ (None where the hold does not reach the next sample) multiply the rows
    of V⁻¹B. ``d…`` (…, n, n) are the divided differences f[λi, λj], the factors of the Fréchet
    derivative in the eigenbasis (Higham, Functions of Matrices, 2008, theorem 3.11).
    """

    phi: ComplexArray
    gamma: ComplexArray
    gamma_next: ComplexArray | None
    dphi: ComplexArray
    dgamma: ComplexArray
    dgamma_next: ComplexArray | None


@dataclass(frozen=True)
class Hold:
    """Base of the holds: use ZeroOrderHold, FirstOrderHold or BandLimited.

    A subclass with a ``name`` is known by it wherever an argument ``hold`` takes one.
    """

    name: ClassVar[str] = ""
    reaches_next: ClassVar[bool] = False
    constant: ClassVar[bool] = False
    named: ClassVar[dict[str, type[Hold]]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "name" in cls.__dict__:
            Hold.named[cls.name] = cls

    @classmethod
    def at(cls, dt: float) -> Hold:
        """The hold of this kind for samples ``dt`` (s) apart."""
        return cls()

    @property
    def column(self) -> tuple[str, float | bool]:
        """Name and value of the column by which a file remembers this hold."""
        return self.name, True


@dataclass(frozen=True)
class PeriodicHold(Hold):
    """A hold that repeats every ``period`` seconds; a subclass gives its ``pulse``.

    Its response is C (zI − Φ)⁻¹ (Γ + z Γ⁺) + D with z = exp(jω·period), whatever the sample time
    of the record.
    """

    period: float
    pulse: ClassVar[Pulse]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.reaches_next, cls.constant = cls.pulse.reaches_next, cls.pulse.constant

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", positive("period", self.period, "s"))

    @classmethod
    def at(cls, dt: float) -> Hold:
        """The hold of this kind for samples ``dt`` (s) apart."""
        return cls(dt)

    @property
    def column(self) -> tuple[str, float | bool]:
        """Name and value of the column by which a file remembers this hold."""
        return f"{self.name}_period", self.period

    def sampled(self, A: FloatArray, B: FloatArray) -> Sampled:
        """Sampled matrices of x' = A x + B u under this hold.

        Args: A (n, n), B (n, m). Returns ``Sampled``. Raises ValueError on shapes that disagree.

        >>> from freqid import ZeroOrderHold
        >>> ZeroOrderHold(0.1).sampled(np.array([[-1.0]]), np.array([[1.0]])).phi.round(6)
        array([[0.904837]])
        """
        A, B = _checked(A, B)
        units = Units.of(A, B, self.period)
        within = units.into(A, B)
        found = self._sampled(*within)
        if doubled_where_needed() and units.hide(found.phi):
            found = self._sampled(*within, exact=True)
        return Sampled(*units.back(*found))

    def _sampled(self, A: FloatArray, B: FloatArray, exact: bool = False) -> Sampled:
        """The same in units that suit, with twice the digits on the way where they are needed."""
        h = self.period
        if exact or _fast(A * h):
            step = Doubled.product(A, h), Doubled.product(B, h)
            found = self._of(doubled_exponential(self._generator(*step)), B.shape)
            # by itself, Φ keeps its digits however little of the states is left
            found = found._replace(phi=doubled_exponential(step[0]).high)
            if all(np.isfinite(M).all() for M in found):
                return found
        return self._blocks(exponential(self.pulse.generator(A * h, B * h)), B.shape)

    def sampled_derivatives(
        self, A: FloatArray, B: FloatArray, dA: FloatArray, dB: FloatArray
    ) -> tuple[Sampled, Sampled]:
        """Sampled matrices and their exact derivatives along each direction (dA[p], dB[p]).

        Args: A (n, n), B (n, m), dA (P, n, n), dB (P, n, m). The derivative is the top right block
        of exp([[X, dX], [0, X]]) (Van Loan, IEEE Trans. Automatic Control 23, 1978), which needs
        no eigenvectors and so holds for defective plants.
        """
        A, B = _checked(A, B)
        if len(dA) == 0:
            return self.sampled(A, B), Sampled(dA, dB, dB)
        h, units = self.period, Units.of(A, B, self.period)
        A, B = units.into(A, B)
        dA, dB = units.into(dA, dB)
        lengths = near_one(h * np.abs(np.concatenate([dA, dB], axis=-1)).max(axis=(1, 2)))
        dA, dB = lengths[:, None, None] * dA, lengths[:, None, None] * dB
        value, change = self._differentiated(A, B, dA, dB)
        if doubled_where_needed() and units.hide(value.phi):
            value, change = self._differentiated(A, B, dA, dB, exact=True)
        back = units.back(*(M / lengths[:, None, None] for M in change))
        return Sampled(*units.back(*value)), Sampled(*back)

    def _differentiated(
        self, A: FloatArray, B: FloatArray, dA: FloatArray, dB: FloatArray, exact: bool = False
    ) -> tuple[Sampled, Sampled]:
        """The same in units that suit, along directions of a length that does."""
        h = self.period
        X = self.pulse.generator(A * h, B * h)
        dX = self.pulse.generator(dA * h, dB * h, moving=True)
        size = len(X)
        big = np.zeros((len(dA), 2 * size, 2 * size), X.dtype)
        big[:, :size, :size] = big[:, size:, size:] = X
        big[:, :size, size:] = dX
        if exact or _fast(A * h):
            low = self._generator(Doubled.product(A, h), Doubled.product(B, h)).low
            both = np.broadcast_to(scipy.linalg.block_diag(low, low), big.shape)
            every = doubled_exponential(Doubled(big, both))
            parts = (part[:, :size, size:] for part in every)
            change = self._of(Doubled(*parts), B.shape)
            if all(np.isfinite(M).all() for M in change):
                return self._sampled(A, B, exact), change
        E = exponential(big)
        value = self._blocks(E[0, :size, :size], B.shape)
        return value, self._blocks(E[:, :size, size:], B.shape)

    def modal(self, eigenvalues: ComplexArray) -> ModalSampled:
        """φ, γ, γ⁺ and their divided differences at the eigenvalues of A, (…, n) in rad/s."""
        h = self.period
        phi, value, dphi, slope = self.pulse.functions(eigenvalues * h)
        return ModalSampled(
            phi,
            h * value.now,
            None if value.following is None else h * value.following,
            h * dphi,
            h**2 * slope.now,
            None if slope.following is None else h**2 * slope.following,
        )

    def _generator(self, A: Doubled, B: Doubled) -> Doubled:
        """The pulse's generator of matrices that are known to more than a double's digits."""
        return Doubled(
            self.pulse.generator(A.high, B.high), self.pulse.generator(A.low, B.low, moving=True)
        )

    def _of(self, exponential: Doubled, shape: tuple[int, ...]) -> Sampled:
        """Sampled matrices from an exponential; what cancels between its blocks is not lost."""
        high, low = (self._blocks(M, shape) for M in exponential)
        return Sampled(*(a + b for a, b in zip(high, low, strict=True)))

    def _blocks(self, exponential: Array, shape: tuple[int, ...]) -> Sampled:
        phi, (gamma, following) = self.pulse.blocks(exponential, *shape)
        return Sampled(phi, gamma, np.zeros_like(gamma) if following is None else following)


def _fast(step: FloatArray) -> bool:
    """Whether motions are so fast within a period that doubles leave too little of slow ones, where
    that is wanted better.
    """
    return doubled_where_needed() and float(np.linalg.norm(step, 1)) > _LARGE


def _checked(A: FloatArray, B: FloatArray) -> tuple[FloatArray, FloatArray]:
    A, B = numbers("A", A), numbers("B", B)
    if A.ndim != 2 or A.shape[0] != A.shape[1] or B.ndim != 2 or B.shape[0] != A.shape[0]:
        raise InputError(
            f"A has shape {A.shape} and B has shape {B.shape}; expected (n, n) and (n, inputs)"
        )
    for name, M in (("A", A), ("B", B)):
        if not np.isfinite(M).all():
            raise InputError(f"{name} has entries that are NaN or infinite; expected numbers")
    return A, B


def known_hold(name: str, value: object) -> Hold:
    """The hold that an argument is; ValueError for anything else, a name without period too."""
    if not isinstance(value, Hold):
        raise InputError(
            f"{name}={value!r} is not a hold; give ZeroOrderHold(period), FirstOrderHold(period) "
            "or BandLimited()"
        )
    return value


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
    if isinstance(hold, str) and hold in Hold.named:
        kind = Hold.named[hold]
        if issubclass(kind, PeriodicHold) and not dt > 0:
            raise InputError(
                f"hold={hold!r} means one at the sample time, which is {dt:g} s here; give dt, or "
                f"{kind.__name__}(period)"
            )
        return kind.at(dt)
    names = ", ".join(map(repr, Hold.named))
    kinds = ", ".join(
        f"{kind.__name__}({'period' if issubclass(kind, PeriodicHold) else ''})"
        for kind in Hold.named.values()
    )
    raise InputError(
        f"hold={hold!r} is not a hold; expected {names} (at the record's sample time), {kinds} or "
        "None"
    )
