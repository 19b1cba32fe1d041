"""A model beside a record: simulated with its input, what is left, and how much is explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, choice
from freqid.data import Band, Record, as_band, chosen
from freqid.fitting import line_errors
from freqid.lti import Hold
from freqid.models import ModelLike, as_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model beside a record.

    ``measured`` (N, outputs) is the record's output, or its part in the band; ``simulated`` and
    ``residuals`` = measured − simulated are shaped like ``record.y``; ``fit_percent`` (outputs,)
    is 100·(1 − ‖residual‖/‖y − mean‖), the normalised root mean square.
    """

    record: Record
    measured: FloatArray
    simulated: FloatArray
    residuals: FloatArray
    fit_percent: FloatArray
    hold: Hold

    def plot(self, ax: Sequence[Axes] | None = None) -> Any:
        """Measured and simulated outputs above their difference; returns the axes."""
        from freqid.plots import plot_comparison

        return plot_comparison(self, ax)

    def __repr__(self) -> str:
        each = ", ".join(
            f"{n} {f:.2f} %"
            for n, f in zip(self.record.output_names, self.fit_percent, strict=True)
        )
        return f"<Comparison: {each}, input held by {self.hold!r}>"


def compare(
    model: ModelLike,
    record: Record,
    *,
    hold: Hold | str | None = None,
    initial_state: str = "estimate",
    band: tuple[float, float] | None = None,
) -> Comparison:
    """Simulate a model with a record's input, and set the two side by side.

    Args:
        model: an Estimate, a GreyBox, a rational model or a control system.
        hold: what the input does; None is what the record remembers, whatever the fit assumed. A
            discrete black box simulates at the hold that it was fitted with.
        initial_state: ``"estimate"`` fits the initial state to this record, ``"steady"`` takes the
            input to be periodic.
        band: in Hz; only what lies inside it is compared, of both. None compares everything.

    Raises ValueError for channels that do not match, or a band that the record does not have.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3)
    >>> bool(fq.compare(fq.first_order(), record).fit_percent[0] > 99.999)
    True
    """
    if not isinstance(record, Record):
        raise InputError(f"record={type(record).__name__} is not a Record; compare them one by one")
    limits = as_band(band, record.nyquist)
    choice("initial_state", initial_state, ("estimate", "steady"))
    given, hold = as_model(model), own_hold(model, hold)
    residual = -line_errors(given, record, hold, None, initial_state).in_time()
    y = record.outputs[: len(residual)]
    if limits is not None:
        y, residual = part_inside(y, record.dt, limits), part_inside(residual, record.dt, limits)
    centred = np.linalg.norm(y - y.mean(axis=0), axis=0)
    left = np.linalg.norm(residual, axis=0)
    percent = 100 * (1 - left / np.where(centred > 0, centred, np.inf))
    shape = (len(residual),) if record.y.ndim == 1 else residual.shape
    used = record.hold if hold is None or isinstance(hold, str) else hold
    simulated = (y - residual).reshape(shape)
    return Comparison(record, y, simulated, residual.reshape(shape), percent, used)


def own_hold(model: ModelLike, hold: Hold | str | None) -> Hold | str | None:
    """The hold asked for, or the one that a sampled model has inside."""
    return as_model(model).own_hold if hold is None else hold


def part_inside(x: FloatArray, dt: float, band: Band) -> FloatArray:
    """The part of signals (N, channels) inside a band; ValueError where it holds no line."""
    X = np.fft.rfft(x, axis=0)
    X[~chosen(np.fft.rfftfreq(len(x), dt), band)] = 0
    return np.fft.irfft(X, len(x), axis=0)
