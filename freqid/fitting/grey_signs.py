"""What the fit of a grey box itself says against its estimate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.data import output_dt, units_of_channels
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding, Unread
from freqid.fitting.reading import Reading
from freqid.fitting.reading_sets import aliased_part
from freqid.fitting.sight import gone_with, hold_that_changes, out_of_sight
from freqid.fitting.signs import Evidence, findings
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.lti import Hold, InputHolds, StateSpace, rounding, sentence

# rates less far apart cost no fit as many digits as are worth a word
_APART = 1e4


def signs_of(
    structure: GreyStructure, minimum: Minimum, readings: Sequence[Reading], hold: Hold
) -> Sequence[Finding]:
    """The findings, read when somebody asks for them."""
    return Unread(lambda: findings(_evidence(structure, minimum, readings, hold)))


def _evidence(
    structure: GreyStructure, minimum: Minimum, readings: Sequence[Reading], hold: Hold
) -> Evidence:
    """What they are read from."""
    reading, model = readings[0], structure.at(minimum.x)
    plant = model.state_space()
    values, count = minimum.x * structure.scale, structure.count
    std = np.sqrt(np.diag(Spread(structure.scale, minimum).covariance))
    held = None
    if HoldPeriod.name in structure.names:
        place = structure.names.index(HoldPeriod.name)
        held = float(values[place]), float(std[place])
    poles = np.linalg.eigvals(plant.A).astype(complex)
    return Evidence(
        structure.parameters,
        values[:count],
        std[:count],
        "" if minimum.solution.converged else minimum.solution.message,
        minimum.determined.sentences,
        held,
        output_dt(reading.data),
        minimum.objective.n_rows,
        len(values),
        out_of_sight=out_of_sight(poles, hold_that_changes(hold, reading.data)),
        gone=gone_with(model, poles, structure.parameters, output_dt(reading.data)),
        aliased=aliased_part(readings),
        rounding=_rounding(plant, hold, reading, minimum.objective.experiments[0]),
        units=dict.fromkeys(
            each
            for r in readings
            for each in units_of_channels(
                (*r.data.input_names, *r.data.output_names), getattr(r.data, "units", {})
            )
        ),
        tied=[(model.parameter(n), tie, model[n]) for n, tie in model.ties.items()],
        exact=minimum.exact,
        # what rounding leaves wants nothing
        wanted=values[:count] if minimum.exact else (minimum.unbounded * structure.scale)[:count],
    )


def _rounding(
    plant: StateSpace, hold: Hold, reading: Reading, fitted: Experiment
) -> tuple[float, str]:
    """How far rounding of the matrices moves what was fitted, and the sentence on it."""
    lines = fitted if isinstance(fitted, SpectralExperiment) else reading.at_lines().lines()
    omega = lines.lines.omega
    if isinstance(hold, InputHolds) or not len(omega):
        return 0.0, ""
    low = omega[omega > 0].min(initial=np.inf)
    at = np.geomspace(low, omega.max(), 3) if low < np.inf else omega[:0]
    lost = rounding(plant, hold, at, _APART)
    return lost, sentence(plant, lost) if lost else ""
