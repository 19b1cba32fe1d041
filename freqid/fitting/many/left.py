"""What many minima leave of their records: error bars, and whether anything is in doubt."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy

from freqid.checks import Array, BoolArray, ComplexArray, FloatArray
from freqid.fitting.cost.many_costs import ManyCosts, ManyPoints
from freqid.fitting.uncertainty.evenness import levels_of_evenness
from freqid.fitting.uncertainty.gradient_noise import FEW, larger
from freqid.fitting.uncertainty.noise_of_series import MOST_LEVERAGE
from freqid.fitting.uncertainty.noise_spectrum import smoothed_power
from freqid.lti import PeriodicHold

# level below which something else is there, and relative standard error of what is open
_LEVEL, _OPEN = 0.01, 0.3
# part of the data's energy that is down to rounding; part of the largest eigenvalue that is none
_EXACT, _SILENT = 1e-15, 1e-12
# a direction of which so little is its own is that of others
_SAME = 1e-9


class Left:
    """What is left at minima ``x`` (S, P) of S records; ``inverse`` is that of JᵀJ (S, P, P), the
    transients being taken off the Jacobian.
    """

    @np.errstate(all="ignore")
    def __init__(
        self,
        costs: ManyCosts,
        x: FloatArray,
        at: ManyPoints,
        inverse: FloatArray,
    ) -> None:
        self.costs, self.x, self.at, self.inverse, self.e = costs, x, at, inverse, costs.first
        # real values that neither parameters nor initial states have taken
        self.rows = 2 * self.e.n_lines * costs.Y.shape[1]
        self.freedom = max(self.rows - at.transient.shape[1] - x.shape[1], 1)

    @cached_property
    @np.errstate(all="ignore")
    def std(self) -> FloatArray:
        """Standard errors (S, P), whatever the noise's colour: as those of a single fit."""
        J, T, S = self.at.jacobian, self.at.transient, len(self.x)
        taken = _leverage(J, self.inverse) + _leverage(T, self.at.inverse)
        taken = np.minimum(taken.reshape(S, -1, 2).mean(axis=-1), MOST_LEVERAGE)
        power = smoothed_power(self._lines() / np.sqrt(1 - taken).reshape(S, -1, self.e.n_lines))
        each = np.repeat(power.reshape(S, -1) / 2, 2, axis=-1)
        score = (J * each[:, None]) @ J.swapaxes(-1, -2) * (self.rows / self.freedom)
        if self.e.n_rows < FEW:
            # lines at zero and at the Nyquist limit are real
            told = max(self.freedom - self.rows + self.e.n_rows, 1)
            H, white = J @ J.swapaxes(-1, -2), self.at.cost / told
            every = zip(score, white, H, strict=True)
            score = np.array([larger(own, level * h, h) for own, level, h in every])
        return np.asarray(np.sqrt(np.einsum("spp->sp", self.inverse @ score @ self.inverse)))

    @cached_property
    @np.errstate(all="ignore")
    def certain(self) -> BoolArray:
        """Of which records nothing is in doubt, (S,): every parameter is told and physical, and
        what is left is white noise of which poles of their own would explain no more; and no mode
        lies where samples cannot see it.
        """
        s = self.costs.structure
        physical = np.array([p.physical for p in s.parameters]).T / s.scale
        inside = (self.x > np.maximum(s.lower, physical[0])).all(axis=1)
        inside &= (self.x < np.minimum(s.upper, physical[1])).all(axis=1)
        told = (self.std <= _OPEN * np.abs(self.x)).all(axis=1)
        noisy = self.at.cost > _EXACT * self.costs.energy
        even = levels_of_evenness(self._lines()).min(axis=-1) >= _LEVEL
        return np.asarray(inside & told & noisy & even & self._seen & (self._level() >= _LEVEL))

    @cached_property
    def _poles(self) -> ComplexArray:
        """Those of the plants in rad/s, (S, n)."""
        s = self.costs.structure
        A = s.model.linearise_many(self.x * s.scale, s.physical_names).at.A
        return np.linalg.eigvals(A).astype(complex)

    @property
    def _seen(self) -> BoolArray:
        """Whether all modes lie below the Nyquist frequency of the hold, (S,)."""
        assert isinstance(self.e.hold, PeriodicHold)
        return np.asarray((self._poles.imag <= np.pi / self.e.hold.period).all(axis=1))

    def _lines(self) -> ComplexArray:
        """Residuals (S, outputs, K)."""
        return self.at.residual.view(complex).reshape(len(self.x), -1, self.e.n_lines)

    def _level(self) -> FloatArray:
        """How often noise alone lets poles of their own explain so much more, (S,).

        What a rational function gains from here is what its derivatives by residues, poles and
        feedthrough explain: 1/(z − φ), 1/(z − φ)² and 1.
        """
        s, hold = self.costs.structure, self.e.hold
        assert isinstance(hold, PeriodicHold)
        phi = np.exp(self._poles * hold.period)[..., None]
        z = self.e.points.z
        one = 1 / (z - phi)
        shapes = [one, one**2]
        if phi.imag.any():
            other = 1 / (z - phi.conj())
            # a pair of poles has real coefficients of a sum and of a difference
            shapes = [
                np.where(phi.imag > 0, a + b, np.where(phi.imag < 0, 1j * (a - b), a))
                for a, b in ((one, other), (one**2, other**2))
            ]
        if hold.reaches_next or s.model.state_space().D.any():
            shapes.append(np.ones((len(phi), 1, len(z)), complex))
        gain, count = self._explained(np.concatenate(shapes, axis=1))
        more = np.maximum(count - self.x.shape[1], 0)
        below = np.maximum(self.freedom - more, 1)
        f = gain / np.maximum(more, 1) / ((self.at.cost - gain) / below)
        return np.where(more > 0, scipy.stats.f.sf(f, np.maximum(more, 1), below), 1.0)

    def _explained(self, ways: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """What responses (S, C, K) from each input to each output explain of what is left (S,), and
        how many directions of it they have.
        """
        U, r = self.costs.U[:, :, 0], self.at.residual
        S, p, K = len(self.x), self.costs.Y.shape[1], self.e.n_lines
        rows = (ways[:, :, None] * U[:, None]).reshape(S, -1, K).view(float)
        across = rows.swapaxes(-1, -2)
        # each output has its own, which are the same beside another part of what is left
        T = self.at.transient.reshape(S, -1, p, 2 * K)
        own = rows @ across
        told = [rows @ each[..., None] for each in r.reshape(S, p, -1).swapaxes(0, 1)]
        taken = [rows @ T[:, :, o].swapaxes(-1, -2) for o in range(p)]
        return _gains(own, np.stack(taken, axis=1), np.stack(told, axis=1), self.at.inverse)


def _gains(
    own: FloatArray, taken: FloatArray, told: FloatArray, inverse: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What rows explain (S,) on how many directions (S,) by their products with one another
    (S, C, C), with the transients (S, p, C, q) and with what is left (S, p, C, 1) at each output.
    """
    S, p, C, _ = told.shape
    size = np.sqrt(np.einsum("scc->sc", own))
    size = np.tile(np.where(size > 0, size, 1.0), p)
    gram = np.zeros((S, p, C, p, C))
    for o in range(p):
        gram[:, o, :, o] = own
    seen = taken.reshape(S, p * C, -1)
    clear = gram.reshape(S, p * C, p * C) - seen @ inverse @ seen.swapaxes(-1, -2)
    values, V = np.linalg.eigh(clear / size[:, :, None] / size[:, None])
    kept = values > _SAME * values[:, -1:]
    along = (V.swapaxes(-1, -2) @ (told.reshape(S, p * C, 1) / size[..., None]))[..., 0]
    gains = np.where(kept, along**2 / np.where(kept, values, 1.0), 0.0)
    return gains.sum(axis=1), kept.sum(axis=1).astype(float)


def _leverage(rows: FloatArray, inverse: FloatArray) -> FloatArray:
    """Part of each error that rows (S, q, R) have taken on themselves, (S, R)."""
    return np.asarray(np.einsum("sqk,sqk->sk", rows, inverse @ rows))


def inverse_of(H: FloatArray) -> tuple[FloatArray, BoolArray]:
    """That of matrices (S, P, P), and whether the data tell every direction, (S,)."""
    size = np.sqrt(np.einsum("spp->sp", H))
    fine = np.isfinite(H).all(axis=(1, 2)) & (size > 0).all(axis=1)
    unit = np.where(fine[:, None], size, 1.0)
    both: Array = unit[:, :, None] * unit[:, None]
    values, V = np.linalg.eigh(np.where(fine[:, None, None], H, np.eye(H.shape[-1])) / both)
    told = fine & (values[:, 0] > _SILENT * values[:, -1])
    inverse = (V / np.maximum(values, 1e-300)[:, None]) @ V.swapaxes(-1, -2)
    return inverse / both, told
