"""What is taken to be known of the noise: from it follow the weights of the lines.

A noise model that has a ``name`` is known by it wherever an argument ``weights`` takes one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import ComplexArray, FloatArray, InputError, choice, numbers
from freqid.data import (
    DataSet,
    FrequencyResponse,
    LocalResponse,
    PeriodicResponse,
    Record,
    StampedRecord,
)
from freqid.fitting.uncertainty.noise_spectrum import noise_weights, settled

# lines on either side of one that a window makes err together
_NEAR = 2
# part of an output's power that no sensor's noise is below
_DIGITS = 1e-20


def tells_variance(frf: FrequencyResponse) -> bool:
    """Whether a response has variances to be weighed by: one of zero would be all that counts."""
    return frf.variance is not None and bool((frf.variance > 0).all())


class NoiseModel(ABC):
    """Weights of the squared errors of one data set.

    ``plain`` says that there are none. Where the noise's ``variance`` in each real value of the
    cost is known it is given.
    """

    name: ClassVar[str] = ""
    named: ClassVar[dict[str, type[NoiseModel]]] = {}
    plain: bool = False
    variance: float | None = None

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "name" in cls.__dict__:
            NoiseModel.named[cls.name] = cls

    @classmethod
    def of(cls, data: DataSet) -> NoiseModel:
        """The model for one data set; InputError where that cannot have it."""
        return cls()

    @abstractmethod
    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        """What multiplies |error|², broadcasting against errors (outputs, lines) of a record or
        (outputs, inputs, lines) of a response.
        """

    @property
    def to_be_learnt(self) -> bool:
        """Whether a fit has to come before, and tells it anew."""
        return False

    def learnt(self, error: ComplexArray, n_samples: int) -> NoiseModel:
        """The model after a fit that left these errors (outputs, lines) of so many samples."""
        return self

    def without_first(self, kept: int, every: int) -> NoiseModel:
        """That of the kept lines, where all were told and these are all but the first."""
        return self

    def crossed(self, pair: tuple[int, int]) -> NoiseModel:
        """That of data whose two outputs are in each other's place."""
        return self


class BiasIntegral(NoiseModel):
    """None at all: ones (the bias integral, paper eq. 2), for a response its input spectrum."""

    plain = True

    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        if isinstance(data, FrequencyResponse) and data.input_spectrum is not None:
            return data.input_spectrum
        return np.ones(shape)


@dataclass(frozen=True, eq=False)
class GivenWeights(NoiseModel):
    """An array, (lines,) or as the errors are."""

    given: FloatArray

    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        array = self.given
        if array.shape not in ((shape[-1],), shape):
            raise InputError(f"weights has shape {array.shape}; expected ({shape[-1]},) or {shape}")
        if not np.isfinite(array).all() or (array < 0).any() or not array.any():
            raise InputError("weights must be finite and not negative, with at least one above 0")
        return array

    def without_first(self, kept: int, every: int) -> GivenWeights:
        return GivenWeights(_without_first(self.given, kept, every))

    def crossed(self, pair: tuple[int, int]) -> GivenWeights:
        return GivenWeights(_crossed(self.given, pair))


class ResponseNoise(NoiseModel):
    """1/variance of a response, that of its own measurement; one of few averages as its
    neighbours have it.
    """

    # a complex error of unit variance has half of it in each of its parts
    variance = 0.5

    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        assert isinstance(data, FrequencyResponse)
        assert data.variance is not None
        # local models tell theirs by many lines, and large where they miss a resonance
        alone = data.reach <= _NEAR and not isinstance(data, LocalResponse)
        return 1 / (settled(data.variance) if alone else data.variance)


@dataclass(frozen=True, eq=False)
class ModelNoise(ResponseNoise):
    """1/variance of a response, as large as it is beside a model's: |Ĝ|²/|G|² is the ``share``."""

    share: FloatArray

    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        return super().weights(data, shape) / self.share


@dataclass(frozen=True, eq=False)
class RelativeNoise(NoiseModel):
    """Weights of relative errors, as those of errors: divided by |Ĝ|²."""

    relative: NoiseModel

    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        assert isinstance(data, FrequencyResponse)
        size = np.abs(data.response) ** 2
        if isinstance(self.relative, ResponseNoise):
            return self.relative.weights(data, shape)
        own = np.ones(shape) if self.relative.plain else self.relative.weights(data, shape)
        return own / size


@dataclass(frozen=True, eq=False)
class MeasuredNoise(NoiseModel):
    """``weights="noise"``: 1/variance, a response's own, or of what fits leave of a record.

    Every real value of the noise then adds a half to the cost.
    """

    name: ClassVar[str] = "noise"
    found: FloatArray | None = None

    @classmethod
    def of(cls, data: DataSet) -> NoiseModel:
        if isinstance(data, Record):
            return cls()
        if data.variance is None:
            known = ""
            if data.coherence is not None:
                known = "; of n averages it is abs(G)**2 (1 - coherence) / (n coherence)"
            raise InputError(
                f"weights='noise' needs frf.variance, and this response has none{known}"
            )
        if not tells_variance(data):
            nothing = data.variance == 0
            raise InputError(
                f"weights='noise' needs variances above zero, and frf.variance is 0 at "
                f"{nothing.sum()} of {nothing.size} values, as of records that are alike to the "
                "last digit; give weights=None, or the response with a variance that it can have"
            )
        return ResponseNoise()

    @property
    def variance(self) -> float | None:  # type: ignore[override]
        """That of each real value, once the noise is known."""
        return None if self.found is None else 0.5

    @property
    def plain(self) -> bool:  # type: ignore[override]
        """Before the noise is known."""
        return self.found is None

    @property
    def to_be_learnt(self) -> bool:
        """Each fit tells the noise better than the one before."""
        return True

    def weights(self, data: DataSet, shape: tuple[int, ...]) -> FloatArray:
        if self.found is None:
            return np.ones(shape)
        if not isinstance(data, Record):
            return self.found
        # beyond its digits an output tells nothing, however little a fit leaves of it
        power = ((data.outputs - data.outputs.mean(axis=0)) ** 2).sum(axis=0)
        most = len(data.outputs) / 2 / np.maximum(_DIGITS * power, 1e-300)
        return np.minimum(self.found, most[:, None])

    def learnt(self, error: ComplexArray, n_samples: int) -> NoiseModel:
        return MeasuredNoise(noise_weights(error, n_samples))

    @classmethod
    def of_response(cls, error: ComplexArray, scale: FloatArray) -> MeasuredNoise:
        """By errors (outputs, inputs, K) of a response that tells no variance.

        Times ``scale``, the root of the input's power there, they are those of the output, whose
        noise is smooth.
        """
        each = (error * scale).reshape(-1, error.shape[-1])
        # 1/variance of complex errors, of which each part has half
        return cls(scale**2 * noise_weights(each, 2).reshape(error.shape))

    def without_first(self, kept: int, every: int) -> NoiseModel:
        found = self.found
        return self if found is None else MeasuredNoise(_without_first(found, kept, every))

    def crossed(self, pair: tuple[int, int]) -> NoiseModel:
        found = self.found
        return self if found is None else MeasuredNoise(_crossed(found, pair))


def _without_first(weights: FloatArray, kept: int, every: int) -> FloatArray:
    return weights[..., 1:] if kept < every == weights.shape[-1] else weights


def _crossed(weights: FloatArray, pair: tuple[int, int]) -> FloatArray:
    """Weights (outputs, K) with two rows exchanged; those of all outputs as they are."""
    if weights.ndim < 2 or len(weights) <= max(pair):
        return weights
    turned = weights.copy()
    turned[list(pair)] = weights[list(pair)[::-1]]
    return turned


# an argument ``weights``: none, a name, or an array
Weights = ArrayLike | NoiseModel | None


def as_noise_model(weights: object, data: DataSet) -> NoiseModel:
    """What an argument ``weights`` means for a data set; InputError where it means nothing."""
    if isinstance(weights, NoiseModel):
        return weights
    if weights is None:
        return BiasIntegral()
    if isinstance(weights, str):
        choice("weights", weights, tuple(NoiseModel.named), "None, or an array of weights")
        return NoiseModel.named[weights].of(data)
    return GivenWeights(numbers("weights", weights))  # type: ignore[arg-type]


def noise_models_of(weights: object, sets: Sequence[DataSet], single: bool) -> list[NoiseModel]:
    """One for each data set; InputError for a list of another length. Of a ``single`` set a list is
    an array.
    """
    each = isinstance(weights, (list, tuple)) and not single
    given: list[object] = [*weights] if each else [weights] * len(sets)  # type: ignore[misc]
    if len(given) != len(sets):
        raise InputError(f"weights has {len(given)} entries for {len(sets)} experiments")
    return [as_noise_model(w, d) for w, d in zip(given, sets, strict=True)]


def in_one_unit(models: list[NoiseModel], sets: Sequence[DataSet]) -> list[str]:
    """Weigh plain ones by their noise where others are means over periods, whose cost has no unit;
    what is said of it. InputError where that noise is not known.
    """
    if len({isinstance(d, PeriodicResponse) for d in sets}) == 1:
        return []
    for i, (noise, data) in enumerate(zip(models, sets, strict=True)):
        if not noise.plain or noise.to_be_learnt or isinstance(data, PeriodicResponse):
            continue
        if not isinstance(data, Record) and data.variance is None:
            raise InputError(
                f"data[{i}] is a response without variance beside means over periods, which count "
                "by their noise; give it its variance, or weights="
            )
        if isinstance(data, StampedRecord):
            raise InputError(
                f"data[{i}] has samples at times of their own, which no weights count beside means "
                "over periods; use its regular()"
            )
        models[i] = MeasuredNoise.of(data)
    return ["means over periods count by their noise, and so does what was fitted with them"]
