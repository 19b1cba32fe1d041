"""A model beside a record: simulated with its input, what is left, and how much is explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Literal

import numpy as np

from freqid.checks import Array, FloatArray, InputError, choice
from freqid.data import (
    Band,
    DataSet,
    FrequencyResponse,
    Record,
    StampedRecord,
    as_band,
    chosen,
    input_dt,
)
from freqid.fitting import (
    Estimate,
    errors_at_stamps,
    errors_in_time,
    in_order_of,
    met,
    offset_is_free,
    remembered,
)
from freqid.lti import Hold, PeriodicHold, as_hold
from freqid.models import DiscreteModel, Model, ModelLike, as_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from freqid.plots import Panels


# an output that varies by less than this part of its size is constant
_CONSTANT = 1e-12


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model beside a record, or a response.

    ``measured`` (N, outputs) is the record's output, or its part in the band; ``simulated`` and
    ``residuals`` = measured − simulated are shaped like ``record.y``; ``fit_percent`` (outputs,)
    is 100·(1 − ‖residual‖/‖y − mean‖), the normalised root mean square. Of a response all three
    are (outputs, inputs, K), and ``fit_percent`` is 100·(1 − ‖residual‖/‖response‖).
    """

    record: DataSet
    measured: Array
    simulated: Array
    residuals: Array
    fit_percent: FloatArray
    hold: Hold | None

    def plot(
        self,
        ax: Sequence[Axes] | None = None,
        zoom: bool = False,
        backend: Literal["matplotlib", "plotly"] = "matplotlib",
    ) -> Panels:
        """Measured and simulated outputs above their difference, two axes for each output.

        With ``zoom`` two more: the stretch in which the difference is largest, and the spectra of
        output and difference; ``backend="plotly"`` makes a figure of plotly.
        """
        from freqid.plots import plot_comparison

        return plot_comparison(self, ax=ax, zoom=zoom, backend=backend)

    def __repr__(self) -> str:
        each = ", ".join(
            f"{n} {f:.2f} %"
            for n, f in zip(self.record.output_names, self.fit_percent, strict=True)
        )
        held = "" if self.hold is None else f", input held by {self.hold!r}"
        return f"<Comparison: {each}{held}>"

    def _repr_html_(self) -> str:
        p = len(self.record.output_names)
        # of a response the outputs come first, of a record last
        first = isinstance(self.record, FrequencyResponse)
        errors = abs(self.residuals.reshape(p, -1) if first else self.residuals.reshape(-1, p).T)
        rows = zip(
            self.record.output_names,
            self.fit_percent,
            np.sqrt(np.mean(errors**2, axis=1)),
            errors.max(axis=1),
            strict=True,
        )
        cells = "".join(
            f"<tr><td>{escape(str(name))}</td><td>{fit:.2f} %</td><td>{rms:.3g}</td>"
            f"<td>{most:.3g}</td></tr>"
            for name, fit, rms, most in rows
        )
        held = "" if self.hold is None else f", input held by {self.hold!r}"
        heads = "".join(f"<th>{h}</th>" for h in ("output", "fit", "rms error", "largest error"))
        return (
            f"<p>Comparison{escape(held)}</p>"
            f"<table><thead><tr>{heads}</tr></thead><tbody>{cells}</tbody></table>"
        )


def compare(
    model: ModelLike,
    record: DataSet,
    *,
    hold: Hold | str | None = None,
    initial_state: str = "estimate",
    band: tuple[float, float] | None = None,
) -> Comparison:
    """Simulate a model with a record's input, and set the two side by side.

    A FrequencyResponse, or one of ``control``, is compared with the model's own, through the same
    hold.

    Args:
        model: an Estimate, a GreyBox, a rational model or a control system.
        hold: what the input does; None is what the fit assumed of its data, and else what the
            record remembers. A discrete model keeps its own where the input is held as long as it
            lasts; where it is not, or the record remembers another than the fit's data did, the
            continuous plant inside it is simulated.
        initial_state: ``"estimate"`` fits the initial state to this record, ``"steady"`` takes the
            input to be periodic, ``"zero"`` begins at rest. Offsets of the outputs are fitted with
            it where the Estimate was (``offset="estimate"``). A plant that integrates is simulated
            with the constant part of the input, which a fit leaves out with the line at zero: its
            ``fit_percent`` may be higher than what is told here where a force or an offset of the
            input was not recorded.
            Behind a delay, of a discrete model and of an input that is held for longer than its
            samples a constant force stays free here as well.
        band: in Hz; only what lies inside it is compared, of both, and told of the initial state.
            None compares everything.

    Raises ValueError for channels that do not match, a band that the record does not have, or an
    output that is constant there, of which nothing is to be explained.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3)
    >>> bool(fq.compare(fq.first_order(), record).fit_percent[0] > 99.999)
    True
    """
    if hasattr(record, "frdata"):
        record = FrequencyResponse.from_control(record)
    if isinstance(record, FrequencyResponse):
        return _with_response(model, record, hold, band)
    if not isinstance(record, Record):
        raise InputError(
            f"record={type(record).__name__} is neither a Record nor a FrequencyResponse; compare "
            "several one by one, load() a stream"
        )
    fitted, record = met(model, record), in_order_of(as_model(model), record)
    assert isinstance(record, Record)
    given, hold = held(model, fitted, hold, record)
    if isinstance(record, StampedRecord):
        return _at_stamps(given, record, hold, band)
    limits = as_band(band, record.nyquist)
    choice("initial_state", initial_state, ("estimate", "steady", "zero"))
    free = offset_is_free(model)
    residual = -errors_in_time(given, record, hold, initial_state, free, limits)
    y = record.outputs[: len(residual)]
    if limits is not None:
        y = part_inside(y, record.dt, limits)
        if initial_state == "zero":
            residual = part_inside(residual, record.dt, limits)
    centred = np.linalg.norm(y - y.mean(axis=0), axis=0)
    left = np.linalg.norm(residual, axis=0)
    size = np.linalg.norm(record.outputs[: len(residual)], axis=0)
    for name, varies, whole in zip(record.output_names, centred, size, strict=True):
        if varies <= _CONSTANT * whole or varies == 0:
            raise InputError(
                f"output {name!r} is constant{'' if limits is None else f' in band={limits}'}: "
                "there is nothing to explain; check the channel or the band"
            )
    percent = 100 * (1 - left / centred)
    shape = (len(residual),) if record.y.ndim == 1 else residual.shape
    used = as_hold(hold, record.input_dt, record.hold)
    simulated = (y - residual).reshape(shape)
    return Comparison(record, y, simulated, residual.reshape(shape), percent, used)


def _at_stamps(
    model: Model,
    record: StampedRecord,
    hold: Hold | str | None,
    band: tuple[float, float] | None,
) -> Comparison:
    """The comparison at the times of a log; the signals are drawn on the record's regular grid."""
    if band is not None:
        raise InputError("band needs a grid; take record.regular(), which is resampled")
    left = -errors_at_stamps(model, record, hold)
    y = record.y_logged
    percent = 100 * (1 - np.linalg.norm(left, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0))
    at = record.y_time[0] + record.time
    drawn = np.column_stack([np.interp(at, record.y_time, c) for c in left.T])
    residual = drawn.reshape(record.y.shape)
    used = as_hold(hold, record.input_dt, record.hold)
    return Comparison(record, record.outputs, record.y - residual, residual, percent, used)


def _with_response(
    model: ModelLike,
    frf: FrequencyResponse,
    hold: Hold | str | None,
    band: tuple[float, float] | None,
) -> Comparison:
    """The model's response beside a measured one, each output in per cent."""
    given, found = held(model, met(model, frf), hold, frf)
    ordered = in_order_of(given, frf)
    assert isinstance(ordered, FrequencyResponse)
    frf = ordered
    if band is not None:
        frf = frf.select(band)
    if isinstance(found, str):
        found = as_hold(found, frf.dt or 1.0, frf.hold)
    if found is None:
        found = frf.hold
    G = given.frequency_response(frf.omega, found).response
    if G.shape != frf.response.shape:
        raise InputError(
            f"response has (outputs, inputs) {frf.response.shape[:2]} and the model {G.shape[:2]}"
        )
    left = frf.response - G
    size = np.linalg.norm(frf.response, axis=(1, 2))
    percent = 100 * (1 - np.linalg.norm(left, axis=(1, 2)) / np.where(size > 0, size, np.nan))
    return Comparison(frf, frf.response, G, left, percent, found)


def held(
    model: ModelLike, fitted: Model, hold: Hold | str | None, data: DataSet
) -> tuple[Model, Hold | str | None]:
    """What stands for a model that was ``fitted``, and the hold of its input: the one asked for;
    else what the fit assumed of its data.

    A fit that took what its record remembers says so of another record, too; one that assumed a
    hold at its own sample time assumes it at the other's. A sampled model has its hold inside:
    where the input is held for another time, or in another way than that of the fit's data was, its
    continuous plant stands for it.
    """
    between = _assumed(model, data) if hold is None else hold
    if isinstance(fitted, DiscreteModel):
        own, at = fitted.hold, data.hold
        if isinstance(between, str) and (step := input_dt(data)):
            between = as_hold(between, step, at)
        lasts = between or at
        if not (isinstance(own, PeriodicHold) and isinstance(lasts, PeriodicHold)):
            return fitted, between or own
        ratio = lasts.period / own.period
        # nobody asked for a model of another rate beside a record of which its own is no part
        whole = [r for r in (ratio, (data.dt or 0.0) / own.period) if abs(r - round(r)) < 1e-9 * r]
        meant = hold is not None or isinstance(data, FrequencyResponse) or bool(whole)
        # what the data of a fit remembered is none of the others' that remember another kind
        unlike = isinstance(model, Estimate) and between is None and type(at) is not type(own)
        if abs(ratio - 1) > 1e-9 or unlike:
            return (as_model(fitted.to_continuous()), lasts) if meant else (fitted, own)
        return fitted, between or own
    return fitted, between


def _assumed(model: ModelLike, data: DataSet) -> Hold | None:
    """The hold that a fit assumed where it did not take what its data remembered; None for others,
    to which the other data say what they remember.
    """
    if not isinstance(model, Estimate):
        return None
    said, step = remembered(model)
    if model.hold == said or said is None or "hold_period" in model.names:
        return model.hold if "hold_period" in model.names else None
    if isinstance(model.hold, PeriodicHold) and step and abs(model.hold.period / step - 1) < 1e-9:
        return type(model.hold)(input_dt(data) or model.hold.period)
    return model.hold


def part_inside(x: FloatArray, dt: float, band: Band) -> FloatArray:
    """The part of signals (N, channels) inside a band; ValueError where it holds no line."""
    X = np.fft.rfft(x, axis=0)
    X[~chosen(np.fft.rfftfreq(len(x), dt), band)] = 0
    return np.fft.irfft(X, len(x), axis=0)
