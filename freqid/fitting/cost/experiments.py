"""One experiment as the fit sees it: residuals, their derivatives and the transient basis.

Every experiment answers ``at(realisation)`` with an object that has

    residual   (rows,)    model at rest minus data, weighted, real and imaginary parts in turn
    transient  (q, rows)  what each unknown of the initial state adds to the residual, or None
    jacobian(initial)     (P, rows), given the values of those unknowns

The fit eliminates the unknowns of the initial state (variable projection: Golub and Pereyra,
Inverse Problems 19, 2003).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import FrequencyResponse, ToldNoise, noise_that_is_told
from freqid.fitting.cost.evaluation import SpectralEvaluation, SumOfEvaluations
from freqid.fitting.cost.lines import Lines, Points, Transient, runs
from freqid.frf import Spectra
from freqid.lti import (
    Hold,
    InputHolds,
    PeriodicHold,
    Plane,
    Realisation,
    on_circle,
    points,
)


class Evaluation(Protocol):
    """An experiment at one trial point."""

    residual: FloatArray
    transient: FloatArray | None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows)."""
        ...


class Experiment(Protocol):
    """A data set as residuals. ``n_rows`` counts real values; ``energy`` is a zero model's cost."""

    @property
    def n_rows(self) -> int:
        """Real values."""
        ...

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        ...

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        ...


@dataclass(frozen=True, eq=False)
class SpectralExperiment:
    """DFT lines of a record, or of a frequency response, against the model's.

    ``lift`` inputs of one slow period stand in turn for each input of the plant; a ``discrete``
    model's matrices are taken as they are. ``n_rows`` counts real values. The noise of a
    ``response`` need not be alike at lines that are neighbours, and may go together within the
    ``reach`` of some lines, as ``line_noise`` says where that is known. ``added`` (q, rows) are
    shapes of unknown size in the output, the noise's past and the sensor's ``offsets``, which are
    eliminated with the initial state. ``place`` is the number of the experiment where these differ
    in more than their data.
    """

    lines: Lines
    points: Points
    transient: Transient | None
    hold: Hold
    n_rows: int
    lift: int = 1
    discrete: bool = False
    response: bool = False
    reach: int = 0
    line_noise: ToldNoise | None = None
    added: FloatArray | None = None
    offsets: bool = False
    place: int = 0

    @classmethod
    def of(
        cls,
        lines: Lines,
        hold: Hold,
        transient_dt: float | None,
        n_real: int = 0,
        lift: int = 1,
        plane: Plane | None = None,
        like: SpectralExperiment | None = None,
    ) -> SpectralExperiment:
        """``transient_dt`` is the sample time of the output; None leaves the transient out. An
        experiment ``like`` this one lends what both have.
        """
        # the free motion is that of the sampled states, whatever drives them
        seen_by = hold.groups[0][0] if isinstance(hold, InputHolds) else hold
        lender = (
            like if plane is None and like and like._at_the_points_of(lines, hold, lift) else None
        )
        if lender is not None:
            z, lines = lender.points.z, lines.lent(lender.lines)
        elif lift > 1 and isinstance(hold, PeriodicHold):
            z = on_circle(hold.period * lift * lines.omega)
        else:
            z = points(lines.omega_input.ravel(), seen_by)
        n_rows = 2 * int(np.count_nonzero(lines.scale)) - n_real
        discrete, transient = plane is not None, None
        if transient_dt is not None:
            if lender is not None and lender._moves_freely_as(lines, transient_dt):
                transient = lender.transient
            else:
                transient = Transient.of(lines, transient_dt, seen_by, z, discrete, lift)
        made = cls(lines, Points(z, lines.U), transient, hold, n_rows, lift, discrete)
        return made if plane is None or plane.a == 0 else made.in_plane(plane)

    @classmethod
    def of_record(
        cls,
        s: Spectra,
        n_inputs: int,
        hold: Hold,
        weights: FloatArray,
        transient: bool,
        plane: Plane | None = None,
        like: SpectralExperiment | None = None,
    ) -> SpectralExperiment:
        """Lines of a record; ``weights`` (K,) or (outputs, K) multiply the squared error."""
        scale = np.sqrt(s.multiplicity * weights / s.n_samples)
        scale = np.broadcast_to(scale, s.Y.shape)
        n_real = int(np.count_nonzero(scale[:, s.multiplicity == 1]))
        lines = Lines.weighted(
            s.omega, s.omega_input, s.U.reshape(len(s.U), 1, -1), s.Y[:, None], scale[:, None]
        )
        lift = len(s.U) // n_inputs
        return cls.of(lines, hold, s.dt if transient else None, n_real, lift, plane, like)

    @classmethod
    def of_response(
        cls, frf: FrequencyResponse, hold: Hold, weights: FloatArray, plane: Plane | None = None
    ) -> SpectralExperiment:
        """A measured response: unit input on each channel; ``weights`` broadcast against it."""
        m, K = frf.response.shape[1:]
        U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, K))
        scale = np.broadcast_to(np.sqrt(weights), frf.response.shape)
        lines = Lines.weighted(frf.omega, frf.omega[:, None], U, frf.response, scale)
        made = cls.of(lines, hold, None, plane=plane)
        known = noise_that_is_told(frf)
        return dataclasses.replace(made, response=True, reach=frf.reach, line_noise=known)

    def with_offsets(self, n_samples: int) -> SpectralExperiment:
        """The same where a constant of unknown size is added to each output's samples."""
        zero = self.lines.omega == 0
        if not zero.any():
            return self
        constants = n_samples * np.eye(len(self.lines.Y), dtype=complex)[:, :, None] * zero
        return dataclasses.replace(self, offsets=True).with_shapes(constants)

    def with_shapes(self, shapes: ComplexArray) -> SpectralExperiment:
        """The same where shapes (q, outputs, K) of unknown size are added to the outputs' lines."""
        if not len(shapes):
            return self
        return self.with_rows(
            (shapes[:, :, None] * self.lines.scale).reshape(len(shapes), -1).view(float)
        )

    def with_rows(self, rows: FloatArray) -> SpectralExperiment:
        """The same where these rows (q, rows) of the residual are of unknown size."""
        rows = rows[rows.any(axis=1)]
        before = [] if self.added is None else [self.added]
        return dataclasses.replace(self, added=np.concatenate([*before, rows]))

    def in_plane(self, plane: Plane) -> SpectralExperiment:
        """The same lines of a sampled model, in z until now, seen in another plane."""
        return dataclasses.replace(
            self,
            points=self.points.in_plane(plane, self.lines.U),
            transient=self.transient and self.transient.in_plane(plane),
        )

    def behind(self, delay: float) -> SpectralExperiment:
        """The same with every input late by ``delay`` (s), as if it were periodic."""
        late = np.exp(-1j * self.lines.omega_input.ravel() * delay)
        return dataclasses.replace(
            self,
            lines=dataclasses.replace(self.lines, U=self.lines.U * late),
            points=Points(self.points.z, self.points.U * late),
        )

    def _at_the_points_of(self, lines: Lines, hold: Hold, lift: int) -> bool:
        """Whether the inputs of lines under a hold act where those of this one do."""
        same = not self.discrete and self.hold == hold and self.lift == lift
        return same and np.array_equal(self.lines.omega_input, lines.omega_input)

    def _moves_freely_as(self, lines: Lines, dt: float) -> bool:
        """Whether the free motion is seen at lines as it is at these."""
        own = self.transient
        return own is not None and own.dt == dt and lines.scale is self.lines.scale

    @property
    def n_lines(self) -> int:
        """Number of lines, whatever their weights."""
        return len(self.lines.omega)

    @property
    def n_channels(self) -> tuple[int, int]:
        """Numbers of outputs and inputs, each input of a lifted plant counted apart."""
        return self.lines.Y.shape[0], self.lines.U.shape[0]

    @property
    def single(self) -> bool:
        """Whether it is of one input and one output, and one channel."""
        return self.lines.Y.shape[:2] == (1, 1) and self.lines.U.shape[:2] == (1, 1)

    @property
    def rational(self) -> bool:
        """Whether it is a rational function of one point at each line, the transient of a hold that
        is remembered from a faster rate only nearly.
        """
        return self.single and self.lines.aliases == 1

    @property
    def one_to_one(self) -> bool:
        """Whether each line takes the resolvent at one point alone."""
        free = self.transient.aliases if self.transient else 1
        return self.lines.aliases == 1 == free

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        return self.lines.energy(moving=self.offsets)

    def thinned(self, part: float = 1.0, evenly: bool = False) -> SpectralExperiment:
        """About a ``part`` of the lines that count, weighted so that costs stay comparable."""
        kept, weight = self.lines.spread(part, evenly)
        return self._some(kept, np.sqrt(weight))

    def moving(self) -> SpectralExperiment:
        """The same without the line at zero where a constant of unknown size takes it up."""
        if not self.offsets:
            return self
        at = np.flatnonzero(self.lines.omega)
        return dataclasses.replace(self._some(at, np.ones(len(at))), offsets=False)

    def _some(self, kept: IntArray, more: FloatArray) -> SpectralExperiment:
        aliases, added = self.lines.aliases, self.added
        if added is not None:
            each = added.view(complex).reshape(len(added), -1, self.n_lines)[..., kept] * more
            rows = each.reshape(len(added), -1)
            added = np.ascontiguousarray(rows[rows.any(axis=1)]).view(float)
        return dataclasses.replace(
            self, lines=self.lines.some(kept, more), added=added, line_noise=None,
            points=self.points.some(runs(kept, aliases), np.repeat(more, aliases)),
            transient=self.transient and self.transient.some(kept, more),
        )  # fmt: skip

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        met = realisation.for_place(self.place)
        if isinstance(self.hold, InputHolds):
            return SumOfEvaluations([e.at(met) for e in self._by_hold])
        return SpectralEvaluation(self, met)

    @cached_property
    def _by_hold(self) -> list[SpectralExperiment]:
        """The same lines with the inputs of each hold alone, the data with the first."""
        assert isinstance(self.hold, InputHolds)
        parts = []
        for number, (hold, members) in enumerate(self.hold.groups):
            own = np.zeros(len(self.lines.U), bool)
            own[members] = True
            keep = own.reshape(-1, *(1,) * (self.lines.U.ndim - 1))
            U, first = self.lines.U * keep, number == 0
            lines = dataclasses.replace(self.lines, U=U, Y=self.lines.Y * first)
            z = points(lines.omega_input.ravel(), hold)
            made = dataclasses.replace(self, lines=lines, points=Points(z, U), hold=hold)
            parts.append(made if first else dataclasses.replace(made, transient=None, added=None))
        return parts


def thinned_to(
    experiments: Sequence[SpectralExperiment], count: int
) -> Sequence[SpectralExperiment]:
    """About ``count`` lines of all experiments together; the same ones where they are fewer."""
    part = count / max(sum(e.n_lines for e in experiments), 1)
    return [e.thinned(part) for e in experiments] if part <= 0.5 else experiments
