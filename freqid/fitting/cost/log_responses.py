"""Responses whose error is a logarithm: magnitude and phase of every line count alike.

log(G/Ĝ) = ln|G/Ĝ| + j arg(G/Ĝ) takes the phase along the model: nothing has to be unwrapped. It is
robust where errors of a response grow with its size (Wernholt and Moberg, Automatica 47, 2011), and
wide: least squares on the response itself is lost once a resonance of the model has moved past
that of the data.
"""

from __future__ import annotations

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import ToldNoise
from freqid.lti import Hold, Realisation, sampled_response

# part of the measured response below which that of a model is none
_DEAF = 1e-8


class LogResponse:
    """log(G/Ĝ) at the lines of an experiment, (outputs, inputs, lines) as real rows.

    ``weight`` (outputs, inputs, lines) multiplies the error: it says how well Ĝ is known. Where it
    is zero there is no error. Errors go together within the ``reach`` of some lines, as
    ``line_noise`` says where that is known.
    """

    def __init__(
        self,
        omega: FloatArray,
        response: ComplexArray,
        hold: Hold,
        weight: FloatArray | float = 1.0,
        place: int = 0,
        reach: int = 0,
        line_noise: ToldNoise | None = None,
    ) -> None:
        self.omega, self.hold, self.reach, self.line_noise = omega, hold, reach, line_noise
        self.weight = np.broadcast_to(weight, response.shape)
        silent = self.weight == 0
        # below this a model says nothing there: it is zero, or that but for rounding
        self.deaf = np.where(silent, np.inf, _DEAF * np.abs(response))
        self.measured = np.where(silent, 1, response)
        self.n_rows, self.place = 2 * response.size, place

    @property
    def turn(self) -> ComplexArray:
        """Ĝ/|Ĝ|, which makes of errors of the logarithm those of the response, in their phase."""
        turned: ComplexArray = self.measured / np.abs(self.measured)
        return turned

    @property
    def energy(self) -> float:
        """Errors of one neper and one radian at every line."""
        return float(self.n_rows)

    def at(self, realisation: Realisation) -> _LogEvaluation:
        """Evaluate at one trial point."""
        return _LogEvaluation(self, realisation.for_place(self.place))

    def ratio(self, G: ComplexArray) -> ComplexArray:
        """G/Ĝ; of a response that is zero the least, and the same everywhere, so that it is far off
        and leads nowhere.
        """
        ratio: ComplexArray = np.where(np.abs(G) > self.deaf, G / self.measured, _DEAF)
        return ratio

    def error(self, G: ComplexArray) -> FloatArray:
        """log(G/Ĝ) as real rows, (…, rows)."""
        ratio = self.ratio(G)
        error = (np.log(np.abs(ratio)) + 1j * np.angle(ratio)) * self.weight
        return error.reshape(*G.shape[:-3], -1).view(float)

    def relative(self, G: ComplexArray, dG: ComplexArray) -> FloatArray:
        """Derivatives of the same, (…, P, rows)."""
        heard = np.abs(G) > self.deaf
        G, weight = np.where(heard, G, 1), np.where(heard, self.weight, 0)
        change = dG / G[..., None, :, :, :] * weight[..., None, :, :, :]
        return change.reshape(*dG.shape[:-3], -1).view(float)


class _LogEvaluation:
    def __init__(self, target: LogResponse, realisation: Realisation) -> None:
        self.target = target
        self.G, self.dG = sampled_response(realisation, target.omega, target.hold)
        self.residual = target.error(self.G)
        self.transient: FloatArray | None = None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        return self.target.relative(self.G, self.dG)
