"""LocalResponse: a response by local models, with what its lines share of the noise."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import Array, BoolArray, ComplexArray, FloatArray, InputError, IntArray
from freqid.data.band import Band, chosen
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.sources import that_follows

if TYPE_CHECKING:
    import pandas as pd

# the column of a table that holds how the noise of lines gets into each
NOISE = "line noise"


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

    def of(self, outputs: Sequence[int], inputs: Sequence[int]) -> LineNoise:
        """The same of some channels, in this order."""
        outputs, inputs = list(outputs), list(inputs)
        return LineNoise(self.first, self.rows[:, outputs][:, :, inputs], self.power[outputs])

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

    def as_texts(self, variance: FloatArray) -> list[str]:
        """What each line of a response of a variance (outputs, inputs, K) has of it, as a column of
        a table holds it: three digits of the rows in standard errors, in base 64.
        """
        K, p, m, E, w = self.rows.shape
        at = self.first[:, None] + np.arange(w)
        size = np.sqrt(np.where(variance > 0, variance, np.inf))
        rows = np.einsum("kpmew,pkw,pmk->pmkew", self.rows, np.sqrt(self.power[:, at]), 1 / size)
        parts = np.stack([rows.real, rows.imag], axis=-1).reshape(p * m * K, -1)
        head = np.stack([np.tile(self.first, p * m), np.full(p * m * K, E)], axis=1)
        texts = np.concatenate(
            [head.astype("<i4").view(np.uint8), parts.astype("<f2").view(np.uint8)], axis=1
        )
        return [base64.urlsafe_b64encode(row.tobytes()).decode() for row in texts]

    @classmethod
    def of_texts(cls, texts: Array, variance: FloatArray) -> LineNoise:
        """From such a column (outputs, inputs, K); ValueError where it is damaged."""
        try:
            raw = [base64.urlsafe_b64decode(text) for text in texts.ravel()]
            whole = np.frombuffer(b"".join(raw), np.uint8).reshape(len(raw), -1)
            first, count = np.ascontiguousarray(whole[:, :8]).view("<i4").T
            parts = np.ascontiguousarray(whole[:, 8:]).view("<f2").astype(float)
            rows = parts.view(complex).reshape(*variance.shape, count[0], -1)
        except (TypeError, ValueError) as error:
            raise InputError(f"column {NOISE!r} is damaged: {error}; leave it out") from None
        p, _, K = variance.shape
        # lines that lie farther apart than a window share nothing, however far
        step = np.diff(first.reshape(-1, K)[0].astype(int), prepend=first[0])
        if (step < 0).any():
            raise InputError(f"column {NOISE!r} is damaged: its lines do not follow one another")
        first = np.cumsum(np.minimum(step, rows.shape[-1]))
        rows = np.moveaxis(rows * np.sqrt(variance)[..., None, None], 2, 0)
        return cls(first, rows, np.ones((p, int(first.max()) + rows.shape[-1])))


@dataclass(frozen=True, eq=False)
class OwnNoise:
    """Noise that each entry of each line has for itself, of a ``variance`` (outputs, inputs, K)."""

    variance: FloatArray

    def along(self, at: ComplexArray) -> FloatArray:
        """Covariance (P, P) of Re Σ conj(at)·error, ``at`` being (P, outputs, inputs, K)."""
        each = (at * np.sqrt(self.variance)).reshape(len(at), -1)
        return np.asarray((each.conj() @ each.T).real / 2)


ToldNoise = LineNoise | OwnNoise


def noise_that_is_told(frf: FrequencyResponse) -> ToldNoise | None:
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
    def select(self, limits: tuple[float, float]) -> LocalResponse:
        """The lines inside ``limits`` (Hz), ends included; ValueError if there are none."""
        kept = super().select(limits)
        at = chosen(self.frequency, Band.of(limits, name="limits"), "limits")
        noise = None if self.line_noise is None else self.line_noise.some(at)
        return LocalResponse(**{**kept.__dict__, "line_noise": noise})

    def to_frame(self) -> pd.DataFrame:
        """As of any response, with a column of the noise that lines share, for ``from_frame``."""
        frame = super().to_frame()
        if self.line_noise is not None and self.variance is not None:
            frame[NOISE] = self.line_noise.as_texts(self.variance)
        return frame
