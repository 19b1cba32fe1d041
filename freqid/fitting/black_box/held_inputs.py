"""What inputs do to states that are held: Γ, D and initial states by linear least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.lti import BandLimited, Basis, StateSpace, basis_of, sum_runs, triangle

# columns and data of each experiment
Rows = list[tuple[FloatArray, FloatArray]]


def inputs_of(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> StateSpace:
    """Γ and D (and the transients, which are dropped) by linear least squares."""
    return inputs_and_cost(experiments, A, C, feedthrough)[0]


def inputs_and_cost(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> tuple[StateSpace, float]:
    """The same, and the sum of squares that they leave.

    Raises LinAlgError where a pole lies on a line.
    """
    n, m, p = len(A), experiments[0].n_channels[1], len(C)
    R, solution = _solved(_rows(experiments, A, C, feedthrough))
    B = solution[: n * m].reshape(m, n).T
    D = np.zeros((p, m))
    if feedthrough:
        D = solution[n * m : n * m + p * m].reshape(m, p).T
    left = R[:, -1] - R[:, :-1] @ solution
    return StateSpace(A, B, C, D), float(left @ left)


def left_by(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> list[FloatArray]:
    """What these leave, the rows of each experiment. Raises LinAlgError as they do."""
    if not len(A) and not feedthrough:
        # nothing acts
        return [e.lines.rows(e.lines.Y) for e in experiments]
    rows = _rows(experiments, A, C, feedthrough)
    solution = _solved(rows)[1]
    return [y - columns @ solution for columns, y in rows]


def _rows(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> Rows:
    """What each entry of Γ and of D, and of the initial states, does at the lines."""
    n, m, p = len(A), experiments[0].n_channels[1], len(C)
    rows = []
    states = _basis(A, C) if n else None
    for index, e in enumerate(experiments):
        CR, lines, transient = _output_rows(states, e.points.z), e.lines, e.transient
        blocks = []
        for j in range(m):
            for i in range(n):
                y = CR[:, i, None, :] * e.points.U[j]
                blocks.append(lines.rows(sum_runs(y, lines.aliases)))
        if feedthrough:
            for j in range(m):
                for o in range(p):
                    y = np.zeros((p, *lines.U.shape[1:]), complex)
                    y[o] = lines.U[j]
                    blocks.append(lines.rows(sum_runs(y, lines.aliases)))
        ends = np.zeros(0) if transient is None else _output_rows(states, transient.z)
        for other in range(len(experiments)):
            if experiments[other].transient is None:
                continue
            for i in range(n):
                if other != index or transient is None:
                    blocks.append(np.zeros(2 * lines.Y.size))
                    continue
                y = ends[:, i, None] * transient.factor
                blocks.append(lines.rows(sum_runs(y, transient.aliases)))
        rows.append((np.array(blocks).T, lines.rows(lines.Y)))
    return rows


def _solved(rows: Rows) -> tuple[FloatArray, FloatArray]:
    """The triangle of all rows, and the solution."""
    columns, right = (np.concatenate(part) for part in zip(*rows, strict=True))
    R = triangle(np.column_stack([columns, right]))
    if not np.isfinite(R).all():
        # LAPACK would write to the terminal by itself
        raise np.linalg.LinAlgError("a pole lies on a line")
    return R, np.linalg.lstsq(R[:, :-1], R[:, -1])[0]


@np.errstate(all="ignore")
def _basis(A: FloatArray, C: FloatArray) -> Basis:
    """Coordinates of the states, each of which is an input."""
    n, p = len(A), len(C)
    return basis_of(StateSpace(A, np.eye(n), C, np.zeros((p, n))))


@np.errstate(all="ignore")
def _output_rows(basis: Basis | None, w: ComplexArray) -> ComplexArray:
    """C (wI − A)⁻¹ of the states before they were changed, (outputs, states, lines); of none where
    there is no ``basis``.
    """
    if basis is None:
        return np.zeros((1, 0, len(w)), complex)
    rows = basis.through(BandLimited()).output_rows(w)
    return np.moveaxis(np.tensordot(basis.to_basis.T, rows, (1, 1)), 0, 1)
