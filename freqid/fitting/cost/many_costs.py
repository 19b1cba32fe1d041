"""Costs of one plant beside many records of one shape, with a leading axis for the records.

The same cost as that of ``Objective``: initial states eliminated, and the Jacobian Kaufman's, from
one kernel call for all. What takes long in a single evaluation is not its arithmetic.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from freqid.checks import Array, BoolArray, FloatArray, IntArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.structures import GreyStructure
from freqid.lti import PeriodicHold, eigenbasis_of_many

# eigenvalues of the transients' Gram matrix below this part of the largest tell nothing of them
_SILENT = 1e-10
# entries of inverses up to which no eigenvalue is as small
_PLAIN = 1e6


@dataclass(frozen=True)
class ManyPoints:
    """Trial points (S, P): residuals (S, rows), the Jacobian (S, P, rows) and the transients
    (S, q, rows), which need not be taken off the Jacobian yet, and the transients' inverse Gram
    matrix (S, q, q).
    """

    residual: FloatArray
    jacobian: FloatArray
    transient: FloatArray
    inverse: FloatArray

    @property
    def cost(self) -> FloatArray:
        """Sums of squares, (S,)."""
        return np.asarray(np.einsum("sk,sk->s", self.residual, self.residual))

    def some(self, which: IntArray) -> ManyPoints:
        """Those of some of the points."""
        parts = self.residual, self.jacobian, self.transient, self.inverse
        return ManyPoints(*(each[which] for each in parts))

    def moved(self, step: FloatArray) -> ManyPoints:
        """The same after steps (S, P) over which residuals are straight lines, and the Jacobian of
        what the initial states do not explain.
        """
        clear = self.without_transients()
        return replace(self, residual=self.residual + (step[:, None] @ clear)[:, 0], jacobian=clear)

    def normal(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost (S,), gradient JᵀR (S, P) and JᵀJ (S, P, P), the transients taken off."""
        J, r, T = self.jacobian, self.residual, self.transient
        seen = J @ T.swapaxes(-1, -2)
        H = J @ J.swapaxes(-1, -2) - seen @ self.inverse @ seen.swapaxes(-1, -2)
        return self.cost, (J @ r[..., None])[..., 0], H

    def without_transients(self) -> FloatArray:
        """The Jacobian (S, P, rows) of what the initial states do not explain."""
        seen = self.jacobian @ self.transient.swapaxes(-1, -2) @ self.inverse
        return np.asarray(self.jacobian - seen @ self.transient)


@dataclass(frozen=True)
class Part:
    """About so much of the ``lines`` (K,) of experiments of one shape, each times a ``factor`` (K,)
    as often as it stands for others; ``first`` is the first of them there.
    """

    lines: IntArray
    factor: FloatArray
    first: SpectralExperiment

    @classmethod
    def of(cls, first: SpectralExperiment, part: float) -> Part:
        """A ``part`` of the lines, where the energy is."""
        lines, weight = first.lines.spread(part, evenly=False)
        return cls(lines, np.sqrt(weight), first.thinned(part))


class ManyCosts:
    """Costs of ``structure`` on records with the same lines, weights and hold."""

    def __init__(self, structure: GreyStructure, experiments: Sequence[SpectralExperiment]) -> None:
        self.structure, self.first = structure, experiments[0]
        self.U = np.stack([e.lines.U for e in experiments])
        self.Y = np.stack([e.lines.Y for e in experiments])
        self.energy = np.array([e.energy for e in experiments])

    @classmethod
    def repeated(
        cls, structure: GreyStructure, experiment: SpectralExperiment, count: int
    ) -> ManyCosts:
        """Those of one record at ``count`` points."""
        made = cls(structure, [experiment])
        made.U = np.broadcast_to(made.U, (count, *made.U.shape[1:]))
        made.Y = np.broadcast_to(made.Y, (count, *made.Y.shape[1:]))
        made.energy = np.repeat(made.energy, count)
        return made

    def thinned(self, part: Part) -> ManyCosts:
        """A part of the lines, weighted so that costs stay comparable."""
        other = copy.copy(self)
        other.first = part.first
        other.U, other.Y = (each[..., part.lines] * part.factor for each in (self.U, self.Y))
        return other

    def some(self, which: slice | IntArray) -> ManyCosts:
        """Those of some of the records."""
        other = copy.copy(self)
        other.U, other.Y, other.energy = self.U[which], self.Y[which], self.energy[which]
        return other

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost (S',), gradient JᵀR (S', P) and JᵀJ (S', P, P) of records ``which`` at x (S', P)."""
        return self.at(x, which).normal()

    @np.errstate(all="ignore")
    def at(self, x: FloatArray, which: Array | None = None) -> ManyPoints:
        """Records ``which``, or all, at x (S', P); not finite where the plant's A is defective."""
        s, e = self.structure, self.first
        matrices, slopes = s.model.linearise_many(x * s.scale, s.physical_names)
        basis = eigenbasis_of_many(matrices, slopes.times(s.scale[:, None, None]))
        plant, z = basis.through(e.hold), e.points.z
        U, Y = (self.U, self.Y) if which is None else (self.U[which], self.Y[which])
        inverse = plant.resolvent(z)
        state = plant.solve(z, plant.drive(z, U), inverse)
        w = plant.output_rows(z, inverse)
        r = _rows(plant.output(state, U) - Y)
        if e.transient is None:
            J = _rows(plant.sensitivity(z, w, state, U, direct=U))
            none = np.zeros((len(x), 0, r.shape[-1]))
            return ManyPoints(r, J, none, np.zeros((len(x), 0, 0)))
        factor = e.transient.factor
        seen = basis.to_basis.swapaxes(-1, -2)[:, None] @ (w * factor)
        T = _rows(seen.swapaxes(1, 2)[:, :, :, None])
        gram = _inverse(T @ T.swapaxes(-1, -2))
        delta = -(gram @ (T @ r[..., None]))
        r = r + (delta.swapaxes(-1, -2) @ T)[:, 0]
        # a resolvent of eigenvalues is never None
        moving = (basis.to_basis @ delta)[..., None] * factor * inverse[:, :, None]  # type: ignore[index]
        J = _rows(plant.sensitivity(z, w, state + moving, U, direct=U))
        return ManyPoints(r, J, T, gram)


def one_shape(experiments: Sequence[SpectralExperiment]) -> bool:
    """Whether experiments differ in nothing but their data, as ``ManyCosts`` wants them."""
    first = experiments[0]
    shared = first.transient is None or first.transient.shared
    if not (shared and isinstance(first.hold, PeriodicHold) and first.one_to_one):
        return False
    if first.lift > 1 or first.discrete or first.added is not None or not first.lines.inside:
        return False
    return all(_alike(first, e) for e in experiments[1:])


def _alike(first: SpectralExperiment, e: SpectralExperiment) -> bool:
    same = e.hold == first.hold and e.lift == first.lift and e.added is None
    return (
        same
        and e.response == first.response
        and (e.transient is None) == (first.transient is None)
        and e.lines.U.shape == first.lines.U.shape
        and e.lines.Y.shape == first.lines.Y.shape
        and bool((e.lines.omega == first.lines.omega).all())
        and bool((e.lines.scale == first.lines.scale).all())
    )


def finite(point: ManyPoints) -> BoolArray:
    """Which points could be computed, (S,)."""
    return np.asarray(np.isfinite(point.cost) & np.isfinite(point.jacobian).all(axis=(1, 2)))


def _rows(values: Array) -> FloatArray:
    """Complex values (S, …, outputs, channels, K) as real rows (S, …, rows)."""
    flat = np.ascontiguousarray(values.reshape(*values.shape[:-3], -1))
    return np.asarray(flat.view(float))


def _inverse(gram: FloatArray) -> FloatArray:
    """That of Gram matrices (S, q, q), of what they tell."""
    size = np.sqrt(np.einsum("sii->si", gram))
    size = np.where((size > 0) & np.isfinite(size), size, 1.0)
    scaled = gram / (size[:, :, None] * size[:, None])
    scaled = np.where(np.isfinite(scaled), scaled, np.eye(gram.shape[-1]))
    try:
        inverse = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        inverse = np.array(np.inf)
    # where all of them tell something of every direction the plain inverse is theirs, and sooner
    if not np.abs(inverse).max(initial=0) < _PLAIN:
        inverse = np.linalg.pinv(scaled, rcond=_SILENT, hermitian=True)
    return np.asarray(inverse / (size[:, :, None] * size[:, None]))
