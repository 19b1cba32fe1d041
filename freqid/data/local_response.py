"""LocalResponse: a response by local models, with what its lines share of the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, IntArray
from freqid.data.band import Band, chosen
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.sources import that_follows


@dataclass(frozen=True, eq=False)
class LineNoise:
    """How the noise of the outputs' lines gets into a response that local models made of them.

    The error of line k is Σ ``rows`` (K, outputs, inputs, E, w) times the noise of w lines of the
    outputs' DFT from ``first`` (K,) on, in each of E experiments; ``power`` (outputs, n) is the
    variance of that noise at the n lines.
    """

    first: IntArray
    rows: ComplexArray
    power: FloatArray

    def __post_init__(self) -> None:
        for array in (self.first, self.rows, self.power):
            array.flags.writeable = False

    def some(self, kept: BoolArray) -> LineNoise:
        """The same of some lines of the response."""
        return LineNoise(self.first[kept], self.rows[kept], self.power)

    @property
    def variance(self) -> FloatArray:
        """That of the response, (outputs, inputs, K), to first order."""
        at = self.first[:, None] + np.arange(self.rows.shape[-1])
        told: FloatArray = np.einsum("kpmew,pkw->pmk", np.abs(self.rows) ** 2, self.power[:, at])
        return told

    def along(self, at: ComplexArray) -> FloatArray:
        """Covariance (P, P) of Re Σ conj(at)·error, ``at`` being (P, outputs, inputs, K)."""
        import scipy.sparse

        K, p, m, E, w = self.rows.shape
        n = self.power.shape[1]
        reached = (self.first[:, None] + np.arange(w))[:, None] + n * np.arange(E)[:, None]
        total = np.zeros((len(at), len(at)))
        line = np.repeat(np.arange(K), E * w)
        for output in range(p):
            met = np.zeros((len(at), E * n), complex)
            for i in range(m):
                entries = self.rows[:, output, i].ravel(), (line, reached.ravel())
                spread = scipy.sparse.csr_array(entries, shape=(K, E * n))
                met += at[:, output, i].conj() @ spread
            total += (met * np.tile(self.power[output], E) @ met.conj().T).real / 2
        return total


@dataclass(frozen=True, eq=False)
class OwnNoise:
    """Noise that each entry of each line has for itself, of a ``variance`` (outputs, inputs, K)."""

    variance: FloatArray

    def along(self, at: ComplexArray) -> FloatArray:
        """Covariance (P, P) of Re Σ conj(at)·error, ``at`` being (P, outputs, inputs, K)."""
        each = (at * np.sqrt(self.variance)).reshape(len(at), -1)
        return np.asarray((each.conj() @ each.T).real / 2)


def noise_that_is_told(frf: FrequencyResponse) -> LineNoise | OwnNoise | None:
    """What a response tells of the noise of its lines; None where its lines share it unknown how,
    and where it tells nothing.
    """
    if isinstance(frf, LocalResponse) and frf.line_noise is not None:
        return frf.line_noise
    told = frf.variance
    if told is None or frf.reach or not (np.isfinite(told) & (told > 0)).all():
        return None
    return OwnNoise(told)


class LocalResponse(FrequencyResponse):
    """A FrequencyResponse whose lines share their noise in a way that is known.

    Attributes:
        line_noise: how the noise of the outputs' lines gets into it; None where it is not known.

    The other arguments are as in ``FrequencyResponse``. The error bars of a ``fit`` to it count
    that neighbouring lines err together. Made by ``local_polynomial`` and ``local_rational``.
    """

    line_noise: LineNoise | None

    def __init__(
        self, *given: object, line_noise: LineNoise | None = None, **fields: object
    ) -> None:
        super().__init__(*given, **fields)  # type: ignore[arg-type]
        self.__dict__["line_noise"] = line_noise

    @that_follows
    def with_conditions(self, **conditions: float) -> LocalResponse:
        """The same with what was set for it, by name."""
        fields = {**self.__dict__, "conditions": {**self.conditions, **conditions}}
        return LocalResponse(**fields)

    @that_follows
    def select(self, limits: tuple[float, float]) -> LocalResponse:
        """The lines inside ``limits`` (Hz), ends included; ValueError if there are none."""
        kept = super().select(limits)
        at = chosen(self.frequency, Band.of(limits, name="limits"), "limits")
        noise = None if self.line_noise is None else self.line_noise.some(at)
        return LocalResponse(**{**kept.__dict__, "line_noise": noise})
