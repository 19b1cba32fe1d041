"""AveragedResponse: a response from segments of signals, with what these cut off its memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, State, flag, numbers, positive
from freqid.data.argument_order import formerly
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.sources import that_follows

if TYPE_CHECKING:
    import pandas as pd

# columns of a table: the memory from its first sample to its last, how many it has, degrees of
# freedom, and whether the input swept through the segments
MEMORY, SEGMENT, FREEDOM, SWEPT = "memory", "segment samples", "degrees of freedom", "swept"


class AveragedResponse(FrequencyResponse):
    """A FrequencyResponse from averages over segments.

    Attributes:
        memory: part of the answer n samples after its input that is seen in the input's own
            segment, (samples of a segment,), one at n = 0; None where nothing is lost, as from
            whole periods. What is measured of a plant with the impulse response g is the transform
            of ``memory`` times g: a lightly damped mode looks broader (Bendat and Piersol, Random
            Data, 2010, section 8.5.1).
        freedom: complex values that have told the variance at each line, its degrees of freedom;
            None where nothing says how many.
        swept: whether the input drove each line in few of the segments, as a sweep longer than
            they are does: ``memory`` then says too little of what they cut off. Not asked of
            streams, whose samples are not in memory.

    The other arguments are as in ``FrequencyResponse``. A ``fit`` to it says by how much that moves
    the parameters. Made by ``h1``, ``h2`` and ``hv``, by ``etfe`` of repeated experiments and by
    ``distortion``.
    """

    memory: FloatArray | None
    freedom: float | None
    swept: bool

    def __init__(
        self,
        *given: object,
        memory: FloatArray | None = None,
        freedom: float | None = None,
        swept: bool = False,
        **fields: object,
    ) -> None:
        super().__init__(*given, **fields)  # type: ignore[arg-type]
        if memory is not None:
            memory = numbers("memory", memory)
            memory.flags.writeable = False
        freedom = None if freedom is None else positive("freedom", freedom)
        self.__dict__.update(memory=memory, freedom=freedom, swept=flag("swept", swept))

    def __setstate__(self, state: State) -> None:
        """Restore; what was written before lacks what was not known then."""
        super().__setstate__({"freedom": None, "swept": False} | state)

    @property
    def of_averages(self) -> Mapping[str, FloatArray | float | None]:
        """What it has beyond other responses, by name."""
        return {"memory": self.memory, "freedom": self.freedom, "swept": self.swept}

    @formerly(band="limits")
    @that_follows
    def select(self, band: tuple[float, float]) -> AveragedResponse:
        """The lines inside ``band`` (Hz), ends included; ValueError if there are none."""
        return AveragedResponse(**{**super().select(band).__dict__, **self.of_averages})

    def to_frame(self) -> pd.DataFrame:
        """As of any response, with columns of the memory from its first sample to its last."""
        frame = super().to_frame()
        if self.memory is not None:
            count, times = len(self.memory), self.response.shape[0] * self.response.shape[1]
            at = np.linspace(0, count - 1, len(self.frequency))
            frame[MEMORY] = np.tile(np.interp(at, np.arange(count), self.memory), times)
            frame[SEGMENT] = count
        if self.freedom is not None:
            frame[FREEDOM] = self.freedom
        if self.swept:
            frame[SWEPT] = True
        return frame


def remembered_memory(column: FloatArray, count: int) -> FloatArray:
    """The memory of so many samples from its column."""
    at = np.linspace(0, count - 1, len(column))
    memory: FloatArray = np.interp(np.arange(count), at, column)
    return memory
