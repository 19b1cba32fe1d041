"""What was known of the parameters before the experiment, as rows beside the data's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.models import Parameter


@dataclass(frozen=True)
class Prior:
    """Rows σ (θ − mean)/std, so that V + Σ rows² is −2σ² times the log of the posterior.

    σ² = ``variance`` is that of the data's noise in each real value of V: the weaker the data, the
    more the prior counts. ``slope`` (rows, P) and ``offset`` (rows,) make the rows
    slope · x − offset.
    """

    slope: FloatArray
    offset: FloatArray
    variance: float

    @classmethod
    def of(
        cls, parameters: Sequence[Parameter], scale: FloatArray, variance: float
    ) -> Prior | None:
        """The prior of these parameters, in units of ``scale`` (P,); None where none has one."""
        known = [(i, p.prior) for i, p in enumerate(parameters) if p.prior is not None]
        if not known:
            return None
        slope, offset = np.zeros((len(known), len(scale))), np.zeros(len(known))
        for row, (i, (mean, std)) in enumerate(known):
            slope[row, i] = np.sqrt(variance) * scale[i] / std
            offset[row] = np.sqrt(variance) * mean / std
        return cls(slope, offset, variance)

    def held(self, index: int, value: float) -> Prior:
        """The prior of the other unknowns where one is held at a value."""
        offset = self.offset - self.slope[:, index] * value
        return Prior(np.delete(self.slope, index, axis=1), offset, self.variance)

    def rows(self, x: FloatArray) -> FloatArray:
        """Jacobian and residual side by side, (rows, P + 1)."""
        return np.column_stack([self.slope, self.slope @ x - self.offset])
