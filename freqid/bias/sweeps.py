"""What one sweep from rest tells of a plant: its information, with both of its ends.

A chirp's density is that of an endless one. A sweep starts and ends somewhere, and what that moves
below and above its band may be nearly all that is known of slow motions. Its information is that of
the fit to the record (Ljung, System Identification, 1999, section 9.4), at the values that the fit
leads to and with the initial state free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.excitation import ChirpSpectrum, InputSpectrum, chirp
from freqid.fitting import GreyStructure, Objective, Reading, determined, read_for
from freqid.lti import Hold, PeriodicHold
from freqid.models import GreyBox, simulate

# samples of a sweep that is looked at: the ends of a longer one say little, and take their time
_MOST = 400_000


@dataclass(frozen=True, eq=False)
class Sweep:
    """Sweeps from rest, one to each input, with what the plant answers at the converter's rate."""

    records: Sequence[Record]
    # at zero an integrator answers with anything at all
    skip_zero: bool
    # of the lines that the fit takes, None for all
    band: tuple[float, float] | None = None

    @classmethod
    def of(
        cls,
        plant: GreyBox,
        spectrum: InputSpectrum,
        duration: float,
        hold: Hold,
        dt: float,
        in_band: bool = False,
    ) -> Sweep | None:
        """None for what is no chirp, is very long, or is held for another time than a sample's."""
        c = spectrum
        if not isinstance(c, ChirpSpectrum) or duration > _MOST * dt:
            return None
        if isinstance(hold, PeriodicHold) and not np.isclose(hold.period, dt, rtol=1e-9):
            return None
        u = chirp(c.low, c.high, duration, dt, c.method, amplitude=c.amplitude)
        alone = np.eye(plant.n_inputs)
        records = [simulate(plant, u[:, None] * row, dt, hold) for row in alone]
        return cls(records, plant.integrates, (c.low, c.high) if in_band else None)

    def covariance(
        self,
        x: FloatArray,
        structure: GreyStructure,
        factor: int,
        hold: Hold | str | None,
        noise_std: float,
    ) -> FloatArray | None:
        """That of the unknowns at ``x`` (P,), (P, P), for noise on every ``factor``-th sample,
        infinite for what is left open; None where there is none.

        What the ends fold moves the estimate as well, by a step to where this sweep's cost is least
        (Gauss and Newton's), which counts as so much error.
        """
        kept, band = [r.decimate(factor) for r in self.records], self.band
        if band is not None:
            if band[0] >= kept[0].nyquist:
                # a fit that is given such a band has no line
                return np.full((len(x), len(x)), np.inf)
            band = band[0], min(band[1], kept[0].nyquist)
        readings = [Reading.of(r, hold, band, skip_zero=self.skip_zero) for r in kept]
        shape = len(self.records[0].output_names), len(self.records)
        objective = Objective(structure, read_for(shape, readings))
        point = objective.point(x)
        if point is None:
            return None
        size = float(np.sqrt(objective.energy))
        told = determined(point.jacobian, x, structure.names, size, structure.scale)
        step = told.inverse @ (point.jacobian.T @ point.residual)
        return told.scatter(noise_std**2 * told.inverse + np.outer(step, step))
