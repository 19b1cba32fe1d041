"""Rows in units of the noise at each line, less what is free or absorbed there.

Parameters that were fitted without these weights are off by what their directions take out of both
what is left and what a suspect does (Neyman's C(alpha), 1959).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.suspects.seen import Seen
from freqid.lti import directions

# singular values below this part of the largest are directions left open
LOOSE = 1e-7


@dataclass(frozen=True, eq=False)
class Weighing:
    """Weights ``w`` (R,), orthonormal rows of what may have been left by initial states and the
    noise's own past, ``taken`` (q, rows) of each experiment, and by parameters, ``absorbed``
    (r, R); what is ``left`` (R,), and the part of each row's noise that is, ``kept`` (R,).
    """

    w: FloatArray
    taken: Sequence[FloatArray]
    absorbed: FloatArray
    left: FloatArray
    kept: FloatArray

    @classmethod
    def of(
        cls, seen: Sequence[Seen], absorbed: FloatArray, left: FloatArray, variance: FloatArray
    ) -> Weighing:
        """By the ``variance`` (R,) of each row's noise; rows ``absorbed`` (c, R) and ``left``."""
        w = 1 / np.sqrt(np.maximum(variance, 1e-300))
        ends = np.cumsum([len(s.left) for s in seen])
        parts = np.split(variance, ends)
        taken = [s.taken(part) for s, part in zip(seen, parts[:-1], strict=True)]
        rows = np.concatenate([left[None], absorbed]) * w
        _taken_off(rows, taken)
        J = rows[1:]
        size = np.linalg.norm(J, axis=1)
        B = directions(J[size > 0] / size[size > 0, None], LOOSE)[2]
        own = np.concatenate([*((Q**2).sum(axis=0) for Q in taken), np.zeros(len(parts[-1]))])
        kept = 1 - own - (B**2).sum(axis=0)
        return cls(w, taken, B, rows[0] - (B @ rows[0]) @ B, kept)

    def clear(self, columns: FloatArray) -> FloatArray:
        """Columns (c, R) in units of the noise, less all that."""
        rows = columns * self.w
        _taken_off(rows, self.taken)
        return rows - (rows @ self.absorbed.T) @ self.absorbed


def _taken_off(rows: FloatArray, taken: Sequence[FloatArray]) -> None:
    """Rows (c, R) less their parts along orthonormal rows of each experiment, in place."""
    at = 0
    for Q in taken:
        part = rows[:, at : at + Q.shape[1]]
        part -= (part @ Q.T) @ Q
        at += Q.shape[1]
