"""How much more than a black box a plant of its order costs, told from their responses alone.

Next to its minimum a black box costs V + |R δ|², δ being the way in its chart. A plant of the same
order is one point of that chart, and its response at a few lines says which: no record is asked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.lti import Hold


@dataclass(frozen=True)
class Surroundings:
    """A black box's response (outputs, inputs, K) at omega (rad/s), derivatives by its unknowns
    (U, …), and their triangle R (rows, U)."""

    omega: FloatArray
    response: ComplexArray
    derivative: ComplexArray
    triangle: FloatArray


class BoxDistance:
    """|R δ|² of responses near that of a black box, as real rows.

    What no black box explains, because the chart is curved, counts as if each line told it alone.
    """

    def __init__(self, box: Surroundings, hold: Hold, place: int = 0) -> None:
        self.omega, self.measured, self.hold, self.place = box.omega, box.response, hold, place
        by = np.moveaxis(box.derivative, 0, -1)
        half = np.linalg.pinv(box.triangle)
        std = np.sqrt((np.abs(by @ half) ** 2).sum(axis=-1))
        self.weight = 1 / np.maximum(std, 1e-9 * np.abs(box.response))
        columns = (by * self.weight[..., None]).reshape(-1, len(box.derivative))
        columns = columns.reshape(len(columns), 1, -1)
        tall = np.concatenate([columns.real, columns.imag], axis=1).reshape(-1, columns.shape[-1])
        Q, S, Vt = np.linalg.svd(tall, full_matrices=False)
        kept = 1e-9 * S[0] < S
        Q, S, Vt = Q[:, kept], S[kept], Vt[kept]
        inside = box.triangle @ (Vt.T / S) @ Q.T
        outside = (np.eye(len(tall)) - Q @ Q.T) / np.sqrt(len(tall))
        self._map = np.concatenate([inside, outside])
        self.n_rows = len(self._map)

    @property
    def energy(self) -> float:
        """The distance of no response at all."""
        rows = self.error(np.zeros_like(self.measured))
        return float(rows @ rows)

    def error(self, G: ComplexArray) -> FloatArray:
        """The way from the black box as rows, (…, rows)."""
        return self._rows(G - self.measured)

    def relative(self, dG: ComplexArray) -> FloatArray:
        """Derivatives of the same, (…, P, rows)."""
        return self._rows(dG)

    def _rows(self, change: ComplexArray) -> FloatArray:
        flat = np.ascontiguousarray((change * self.weight).reshape(*change.shape[:-3], -1))
        return flat.view(float) @ self._map.T
