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
    slope · x − offset. ``variances`` (rows,) are that of the noise where it acts on each parameter,
    which coloured noise makes another for each; None where it is one for all.
    """

    slope: FloatArray
    offset: FloatArray
    variance: float
    variances: FloatArray | None = None

    @classmethod
    def of(
        cls,
        parameters: Sequence[Parameter],
        scale: FloatArray,
        variance: float,
        wider: FloatArray | None = None,
    ) -> Prior | None:
        """The prior of these parameters, in units of ``scale`` (P,); None where none has one.

        By so much ``wider`` (P,), in variance, noise of its own colour makes each parameter scatter
        than white noise would.
        """
        known = [(i, p.prior) for i, p in enumerate(parameters) if p.prior is not None]
        if not known:
            return None
        slope, offset = np.zeros((len(known), len(scale))), np.zeros(len(known))
        each = np.array([variance * (1.0 if wider is None else wider[i]) for i, _ in known])
        for row, (i, (mean, std)) in enumerate(known):
            slope[row, i] = np.sqrt(each[row]) * scale[i] / std
            offset[row] = np.sqrt(each[row]) * mean / std
        return cls(slope, offset, variance, each)

    @property
    def score(self) -> FloatArray:
        """What its own scatter does to the gradient, (P, P)."""
        each = np.full(len(self.slope), self.variance) if self.variances is None else self.variances
        return (self.slope.T * each) @ self.slope

    def held(self, index: int, value: float) -> Prior:
        """The prior of the other unknowns where one is held at a value."""
        offset = self.offset - self.slope[:, index] * value
        slope = np.delete(self.slope, index, axis=1)
        return Prior(slope, offset, self.variance, self.variances)

    def rows(self, x: FloatArray) -> FloatArray:
        """Jacobian and residual side by side, (rows, P + 1)."""
        return np.column_stack([self.slope, self.slope @ x - self.offset])
