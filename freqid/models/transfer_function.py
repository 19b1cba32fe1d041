"""TransferFunction: a continuous-time black box b(s)/a(s), fitted through any hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from freqid.checks import Array, ComplexArray, FloatArray, InputError, finite, whole
from freqid.lti import StateSpace
from freqid.models.grey_box import GreyBox
from freqid.models.model import MatrixModel
from freqid.models.parameter import Parameter

_ANY = (-np.inf, np.inf)


@dataclass(frozen=True)
class TransferFunction:
    """Black box in continuous time with so many zeros and poles for each pair of channels.

    All pairs share their poles and the ``delay`` in s of all inputs, which ``"estimate"`` makes one
    more unknown; a delay needs a zero-order hold or a band-limited input. Raises ValueError for
    numbers that are not whole, more zeros than poles, or a delay that is negative.

    >>> TransferFunction(zeros=2, poles=3)
    TransferFunction(zeros=2, poles=3, delay=0.0)
    """

    zeros: int
    poles: int
    delay: float | str = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "poles", whole("poles", self.poles))
        object.__setattr__(self, "zeros", whole("zeros", self.zeros, least=0))
        if self.zeros > self.poles:
            raise InputError(
                f"zeros={self.zeros} is more than poles={self.poles}; no plant has that"
            )
        if not (isinstance(self.delay, str) and self.delay == "estimate"):
            delay = finite("delay", self.delay)
            if delay < 0:
                raise InputError(f"delay={delay:g} s must not be negative")
            object.__setattr__(self, "delay", delay)


@dataclass(frozen=True, eq=False)
class ContinuousModel(MatrixModel):
    """An estimated continuous-time rational model, x' = A x + B u, y = C x + D u."""

    dt = 0.0

    matrices: StateSpace
    denominator: FloatArray
    numerators: FloatArray
    input_names: Sequence[str]
    output_names: Sequence[str]
    delay: float = 0.0

    @property
    def spec(self) -> TransferFunction:
        """The black box of which this is one: zeros, poles and delay."""
        return TransferFunction(self.numerators.shape[2] - 1, len(self.denominator) - 1, self.delay)

    @property
    def poles(self) -> ComplexArray:
        """Poles in rad/s."""
        return np.roots(self.denominator)

    def zeros(self, output: int = 0, input: int = 0) -> ComplexArray:
        """Zeros from one input to one output, in rad/s."""
        return np.roots(self.numerators[output, input])

    def __repr__(self) -> str:
        p, m = self.matrices.D.shape
        return f"<ContinuousModel {p}x{m}: {len(self.denominator) - 1} poles>"


def chained(
    spec: TransferFunction,
    poles: ComplexArray,
    scale: float,
    names: tuple[Sequence[str], Sequence[str]],
) -> GreyBox:
    """A grey box that runs over all models of this shape, begun at these poles, gains still zero.

    Each input drives a chain of first- and second-order sections s² + p₁ s + p₀, in time scaled by
    ``scale`` (rad/s). Read from its end, the chain's states have numerators 1, s, (s² + p₁ s + p₀),
    … over the common denominator: a Newton basis, which stays well conditioned where powers of s do
    not, and whose first so many members bound the number of zeros. A section's coefficients pass
    smoothly between a complex pair and two real poles.
    """
    sections = _sections(poles / scale)
    parameters = [
        Parameter(f"p{k}_{i}", float(c), physical=_ANY)
        for k, section in enumerate(sections)
        for i, c in enumerate(section)
    ]
    p, m = len(names[1]), len(names[0])
    parameters += [
        Parameter(f"c{o}_{i}_{j}", 0.0, physical=_ANY)
        for o in range(p)
        for i in range(m)
        for j in range(spec.zeros + 1)
    ]
    shape = tuple(len(s) for s in sections)
    return GreyBox(
        partial(_chain_matrices, shape, spec.zeros, p, m, scale),
        parameters,
        inputs=names[0],
        outputs=names[1],
        name="transfer function",
        vectorized=True,
    )


def _sections(poles: ComplexArray) -> list[FloatArray]:
    """Denominators of the sections without their leading one: pairs, then at most one single."""
    left = list(poles[np.argsort(-np.abs(poles.imag))])
    sections, singles = [], []
    while left:
        pole = left.pop(0)
        if abs(pole.imag) > 1e-9 * abs(pole):
            partner = int(np.argmin([abs(q - pole.conjugate()) for q in left]))
            left.pop(partner)
            sections.append(np.array([-2 * pole.real, abs(pole) ** 2]))
        else:
            singles.append(float(pole.real))
    singles.sort()
    while len(singles) > 1:
        a, b = singles.pop(0), singles.pop(0)
        sections.append(np.array([-(a + b), a * b]))
    return sections + [np.array([-s]) for s in singles]


def _chain_matrices(
    shape: tuple[int, ...], zeros: int, p: int, m: int, scale: float, **v: Array
) -> tuple[Array, ...]:
    any_value = v["p0_0"]
    lead, kind = np.shape(any_value), np.result_type(*v.values())
    n = sum(shape)
    A, B = np.zeros((*lead, n * m, n * m), kind), np.zeros((*lead, n * m, m), kind)
    C, D = np.zeros((*lead, p, n * m), kind), np.zeros((*lead, p, m), kind)
    starts = np.concatenate([[0], np.cumsum(shape)]).astype(int)
    # the states of one chain, last section first, each with its rate behind it
    order = [starts[k] + i for k in reversed(range(len(shape))) for i in range(shape[k])]
    for i in range(m):
        base = i * n
        for k, size in enumerate(shape):
            at = base + starts[k]
            last = at + size - 1
            if size == 2:
                A[..., at, at + 1] = 1
                A[..., last, at], A[..., last, last] = -v[f"p{k}_1"], -v[f"p{k}_0"]
            else:
                A[..., last, last] = -v[f"p{k}_0"]
            if k == 0:
                B[..., last, i] = 1
            else:
                A[..., last, base + starts[k - 1]] = 1
        for o in range(p):
            for j in range(zeros + 1):
                c = v[f"c{o}_{i}_{j}"]
                if j < n:
                    C[..., o, base + order[j]] = c
                else:
                    D[..., o, i] = c
    return A * scale, B * scale, C, D


def polynomials(at: StateSpace, zeros: int) -> tuple[FloatArray, FloatArray]:
    """Denominator (…, poles + 1) and numerators (…, outputs, inputs, zeros + 1) in s of a chained
    grey box's matrices (…), highest powers first.
    """
    p, m = at.D.shape[-2:]
    n = at.A.shape[-1] // m
    a = _characteristic(at.A[..., :n, :n])
    numerators = np.zeros((*a.shape[:-1], p, m, zeros + 1))
    for o in range(p):
        for i in range(m):
            block = slice(i * n, (i + 1) * n)
            A, b, c = at.A[..., block, block], at.B[..., block, i], at.C[..., o, block]
            # det(sI − A + b c) = a(s) + c adj(sI − A) b
            full = _characteristic(A - b[..., :, None] * c[..., None, :]) - a
            full = full + at.D[..., o, i, None] * a
            numerators[..., o, i, :] = full[..., n - zeros :]
    return a, numerators


def _characteristic(A: FloatArray) -> FloatArray:
    """det(sI − A) of matrices (…, n, n), highest power first, (…, n + 1)."""
    roots = np.linalg.eigvals(A).astype(complex)
    a = np.ones((*roots.shape[:-1], 1), complex)
    for k in range(roots.shape[-1]):
        none = np.zeros_like(a[..., :1])
        shifted = np.concatenate([none, a], axis=-1) * roots[..., k, None]
        a = np.concatenate([a, none], axis=-1) - shifted
    return np.asarray(a.real)


def rational_model(model: GreyBox, zeros: int, delay: float = 0.0) -> ContinuousModel:
    """Polynomials in s of a chained grey box: the model that a user sees."""
    at = model.state_space()
    names = tuple(model.inputs or ()), tuple(model.outputs or ())
    return ContinuousModel(at, *polynomials(at, zeros), *names, delay)


def coefficients(model: ContinuousModel) -> tuple[list[str], FloatArray]:
    """Names and values of the coefficients: b of each channel pair, highest power first, then a."""
    zeros, poles = model.numerators.shape[2], len(model.denominator) - 1
    names = model.coefficient_names(reversed(range(zeros)), reversed(range(poles)))
    return names, np.concatenate([model.numerators.ravel(), model.denominator[1:]])
