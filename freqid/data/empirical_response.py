"""EmpiricalResponse: the ratio of two DFTs of one experiment, which knows where its input was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError, numbers
from freqid.data.argument_order import formerly
from freqid.data.band import Band, chosen
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.sources import that_follows

if TYPE_CHECKING:
    import pandas as pd

# column of a table
PHASE = "input phase"


class EmpiricalResponse(FrequencyResponse):
    """A FrequencyResponse of one experiment with one input, and the phase of that input's lines.

    Attributes:
        input_phase: of the DFT of the input in rad, (K,); None where it is not known.

    The other arguments are as in ``FrequencyResponse``. What the plant's motion at the ends of the
    record leaks into the lines is C (zI − Φ)⁻¹ z δ over the input's: a ``fit`` to it says by how
    much that moves the parameters (Ljung, System Identification, 1999, section 6.3). Made by
    ``etfe``.
    """

    input_phase: FloatArray | None

    def __init__(
        self, *given: object, input_phase: FloatArray | None = None, **fields: object
    ) -> None:
        super().__init__(*given, **fields)  # type: ignore[arg-type]
        if input_phase is not None:
            input_phase = numbers("input_phase", input_phase)
            if input_phase.shape != self.frequency.shape:
                raise InputError(
                    f"input_phase has shape {input_phase.shape}; expected {self.frequency.shape}"
                )
            input_phase.flags.writeable = False
        self.__dict__["input_phase"] = input_phase

    @property
    def input_lines(self) -> ComplexArray | None:
        """The DFT of the input, (K,); None where that is not known."""
        if self.input_phase is None or self.input_spectrum is None or len(self.input_names) > 1:
            return None
        lines: ComplexArray = np.sqrt(self.input_spectrum[0]) * np.exp(1j * self.input_phase)
        return lines

    @formerly(band="limits")
    @that_follows
    def select(self, band: tuple[float, float]) -> EmpiricalResponse:
        """The lines inside ``band`` (Hz), ends included; ValueError if there are none."""
        kept = super().select(band)
        at = chosen(self.frequency, Band.of(band, name="band"), "band")
        phase = None if self.input_phase is None else self.input_phase[at]
        return EmpiricalResponse(**{**kept.__dict__, "input_phase": phase})

    def to_frame(self) -> pd.DataFrame:
        """As of any response, with a column of the input's phase in rad, for ``from_frame``."""
        frame = super().to_frame()
        if self.input_phase is not None:
            frame[PHASE] = np.tile(self.input_phase, self.response.shape[0])
        return frame
