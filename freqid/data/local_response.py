"""LocalResponse: a response by local models, with what its lines share of the noise."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import Array, BoolArray, ComplexArray, FloatArray, InputError, IntArray, State
from freqid.data.argument_order import formerly
from freqid.data.averaged_response import FREEDOM
from freqid.data.band import Band, chosen
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.sources import that_follows

if TYPE_CHECKING:
    import pandas as pd

# the column of a table that holds how the noise of lines gets into each
NOISE = "line noise"
# lines by which it is judged how much of their noise lines share
_JUDGED = 200


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
        p, m = self.rows.shape[1:3]
        total = np.zeros((len(at), len(at)))
        for output in range(p):
            met = sum(at[:, output, i].conj() @ self._spread(output, i) for i in range(m))
            total += (met @ met.conj().T).real / 2
        return total

    @property
    def shared(self) -> float:
        """Sum of the squares of a line's correlations with all lines, on average: one where each
        has its own noise.
        """
        K, p, m = self.rows.shape[:3]
        some = np.unique(np.linspace(0, K - 1, _JUDGED).astype(int))
        total = 0.0
        for output, i in np.ndindex(p, m):
            spread = self._spread(output, i)
            size = np.sqrt(np.maximum((abs(spread) ** 2).sum(axis=1), 1e-300))
            met = abs(spread[some] @ spread.conj().T).power(2) @ (1 / size**2)
            total += float(np.mean(met / size[some] ** 2))
        return total / (p * m)

    def _spread(self, output: int, i: int) -> scipy.sparse.csr_array:
        """What noise of unit variance adds to one channel pair, (K, E·n)."""
        K, _, _, E, w = self.rows.shape
        n = self.power.shape[1]
        at = self.first[:, None] + np.arange(w)
        rows = self.rows[:, output, i] * np.sqrt(self.power[output, at])[:, None]
        reached = at[:, None] + n * np.arange(E)[:, None]
        line = np.repeat(np.arange(K), E * w)
        return scipy.sparse.csr_array((rows.ravel(), (line, reached.ravel())), shape=(K, E * n))

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
        freedom: complex degrees of freedom of each variance, what a window leaves beside its
            unknowns; None where that is not known.

    The other arguments are as in ``FrequencyResponse``. The error bars of a ``fit`` to it count
    that neighbouring lines err together. Made by ``local_polynomial`` and ``local_rational``.
    """

    line_noise: LineNoise | None
    freedom: float | None

    def __init__(
        self,
        *given: object,
        line_noise: LineNoise | None = None,
        freedom: float | None = None,
        **fields: object,
    ) -> None:
        super().__init__(*given, **fields)  # type: ignore[arg-type]
        self.__dict__.update(line_noise=line_noise, freedom=freedom)

    def __setstate__(self, state: State) -> None:
        """Restore; what was written before lacks what was not known then."""
        super().__setstate__({"freedom": None} | state)

    def of_windows(
        self, outputs: Sequence[int], inputs: Sequence[int]
    ) -> Mapping[str, LineNoise | float | None]:
        """What some of its channels, in this order, have beyond other responses, by name."""
        known = self.line_noise
        return {
            "line_noise": None if known is None else known.of(outputs, inputs),
            "freedom": self.freedom,
        }

    @formerly(band="limits")
    @that_follows
    def select(self, band: tuple[float, float]) -> LocalResponse:
        """The lines inside ``band`` (Hz), ends included; ValueError if there are none."""
        kept = super().select(band)
        at = chosen(self.frequency, Band.of(band, name="band"), "band")
        noise = None if self.line_noise is None else self.line_noise.some(at)
        own = {"line_noise": noise, "freedom": self.freedom}
        return LocalResponse(**{**kept.__dict__, **own})

    def to_frame(self) -> pd.DataFrame:
        """As of any response, with a column of the noise that lines share, for ``from_frame``."""
        frame = super().to_frame()
        if self.line_noise is not None and self.variance is not None:
            frame[NOISE] = self.line_noise.as_texts(self.variance)
            if self.freedom is not None:
                frame[FREEDOM] = self.freedom
        return frame
