"""Which order does a black box need: cost, criteria and cross-validation over DFT lines."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Literal

import numpy as np

from freqid.checks import (
    BoolArray,
    FloatArray,
    InputError,
    an,
    choice,
    flag,
    listed,
    processes,
    whole,
)
from freqid.data import (
    Bar,
    FrequencyResponse,
    Record,
    as_data_sets,
    channel_counts,
    in_turn,
    on_a_grid,
)
from freqid.fitting.black_box.late import in_step
from freqid.fitting.black_box.output_error import fit_output_error, held_out_cost
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import OnLineError
from freqid.fitting.reading import Reading
from freqid.lti import Hold, Plane, tuned
from freqid.models import OutputError

if TYPE_CHECKING:
    import pandas as pd

# every so-manyth line is held out in turn
_FOLDS = 4
# part of the mean energy of the input's lines from which one is driven
_DRIVEN = 0.01
# by so much less MDL a model that grows is no whim of noise
_CERTAIN = 30.0


@tuned
def select_order(
    data: Record | FrequencyResponse,
    orders: Iterable[int],
    *,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
    feedthrough: bool | None = False,
    initial_state: Literal["estimate", "zero", "steady"] = "estimate",
    criterion: Literal["aic", "mdl", "cross_validation"] = "mdl",
    delays: Iterable[int] = (0,),
    stable: bool = False,
    n_jobs: int | None = None,
    progress: bool = False,
) -> pd.DataFrame:
    """Fit OutputError of each order and compare.

    Columns: order, feedthrough, delay, parameters, cost, fit_percent, aic, mdl, cross_validation,
    converged and error, one row for each order. AIC = n ln(V/n) + 2k, MDL = n ln(V/n) + k ln n
    with n real values and k parameters and initial states (Ljung, 1999, section 16.4), of responses
    as many as have noise of their own: what leaks into ``etfe`` and ``h1``, and what a polynomial
    misses, is no noise and asks for more orders than the plant has; take the record, or
    ``local_rational``. Noise that is far from white is described by more orders, too, which
    cross-validation takes for less: it is the cost per real value on each quarter of the lines of
    the model and the initial state fitted to the other three. ``feedthrough=None`` tries both;
    ``delays`` are whole samples by which the inputs may come late. An order that cannot be fitted
    has its reason in ``error``. ``attrs["best"]`` is the order with the least ``criterion``:
    ``"aic"``, ``"mdl"`` or ``"cross_validation"``; ``attrs["feedthrough"]`` and ``attrs["delay"]``
    go with it. Models whose motions certainly grow are not chosen where others explain the data
    about as well; ``attrs["growing"]`` are their rows. Where the largest order of several is chosen
    ``attrs["note"]`` says what cross-validation takes. ``n_jobs`` is a number of processes, None
    this one, as in ``bootstrap``; with ``progress`` the screen shows how many orders are done.
    Other arguments as in ``fit``. Raises ValueError for no orders, or one that is not a whole
    number, or where none can be fitted.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.chirp(2, 40, 2, 1e-3), 1e-3).with_noise(0.01)
    >>> select_order(record, range(1, 4)).attrs["best"]
    1
    """
    import pandas as pd

    data = as_data_sets(data)[0] if hasattr(data, "frdata") else data
    an("data", data, Record, FrequencyResponse)
    on_a_grid(data)
    choice("criterion", criterion, ("aic", "mdl", "cross_validation"))
    choice("initial_state", initial_state, ("estimate", "zero", "steady"))
    if feedthrough is not None:
        flag("feedthrough", feedthrough)
    flag("stable", stable)
    flag("progress", progress)
    given = [orders] if isinstance(orders, int) else listed("orders", orders)
    wanted = [whole("orders", n) for n in given]
    if not wanted:
        raise InputError("orders is empty; give at least one, such as range(1, 7)")
    tried = [delays] if isinstance(delays, int) else listed("delays", delays)
    late = [whole("delays", q, least=0) for q in tried]
    if not late:
        raise InputError("delays is empty; give at least one, such as range(4)")
    reading = Reading.of(data, hold, band, initial_state=initial_state)
    n_inputs = channel_counts(data)[1]
    through = [False, True] if feedthrough is None else [feedthrough]
    processes(n_jobs)
    each = list(product(late, through, wanted))

    def tabled(reading: Reading) -> pd.DataFrame:
        with Bar(progress, len(each), 0, "orders") as advance:
            work = partial(_row_of, reading, (n_inputs, max(late)), stable)
            return pd.DataFrame(in_turn(work, each, n_jobs, lambda _: advance(1)))

    table = tabled(reading)
    if table.pop("on_line").any():
        # an integrator without noise: all orders are asked without the line on which its pole lies
        table = tabled(reading.with_(skip_zero=True)).drop(columns="on_line")
    scores = table[criterion].to_numpy()
    if np.isnan(scores).all():
        raise InputError(f"no order can be fitted: {table['error'].iloc[0]}")
    growing = table.pop("growing").to_numpy(dtype=bool)
    best = table.iloc[_chosen(scores, table["mdl"].to_numpy(), growing)]
    table.attrs["best"] = int(best["order"])
    table.attrs["feedthrough"], table.attrs["delay"] = bool(best["feedthrough"]), int(best["delay"])
    table.attrs["criterion"] = criterion
    table.attrs["growing"] = np.flatnonzero(growing).tolist()
    if note := _at_the_end(table, growing):
        table.attrs["note"] = note
    return table


def _at_the_end(table: pd.DataFrame, growing: BoolArray) -> str:
    """What is to be said where the largest order of several is chosen; else empty."""
    best, most = table.attrs["best"], int(table["order"].max())
    if best < most or most == table["order"].min():
        return ""
    said = f"order {best} is the largest of those tried: offer more"
    held_out = table["cross_validation"].to_numpy()
    if table.attrs["criterion"] == "cross_validation" or np.isnan(held_out).all():
        return said
    other = int(table["order"].iloc[_chosen(held_out, table["mdl"].to_numpy(), growing)])
    if other == best:
        return said
    return (
        f"{said}, or take order {other} of cross-validation: noise that is far from white asks for "
        f"more orders than the plant has by {table.attrs['criterion'].upper()}"
    )


def _chosen(scores: FloatArray, mdl: FloatArray, growing: BoolArray) -> int:
    """The row with the least score; one that grows where nothing else comes near it, as noise draws
    poles far out of the circle, where they stand for a delay that is too long.
    """
    best = int(np.nanargmin(scores))
    tame = np.where(growing, np.nan, scores)
    if not growing[best] or np.isnan(tame).all():
        return best
    other = int(np.nanargmin(tame))
    return other if mdl[other] - mdl[best] < _CERTAIN else best


@tuned
def _row_of(
    reading: Reading, late: tuple[int, int], stable: bool, asked: tuple[int, bool, int]
) -> dict[str, object]:
    """The row of a delay, a feedthrough and an order; ``late`` holds the number of inputs and the
    longest delay of all rows.
    """
    delay, direct, order = asked
    seen = in_step(reading, (delay,) * late[0], late[1])
    return _row(OutputError(order, direct, stable), delay, seen)


def _row(spec: OutputError, delay: int, reading: Reading) -> dict[str, object]:
    """One row of the table; NaN, and the reason, where there is no fit."""
    row: dict[str, object] = {
        "order": spec.order, "feedthrough": spec.feedthrough, "delay": delay, "parameters": 0,
        "cost": np.nan, "fit_percent": np.nan, "aic": np.nan, "mdl": np.nan,
        "cross_validation": np.nan, "converged": False, "error": "", "growing": False,
        "on_line": False,
    }  # fmt: skip
    try:
        est = fit_output_error(spec, [reading])
        held_out = _cross_validation(est, reading)
    except OnLineError as error:
        return {**row, "error": str(error), "on_line": True}
    except (InputError, np.linalg.LinAlgError) as error:
        return {**row, "error": str(error)}
    n, parameters = est.n_rows, len(est.values)
    k = parameters + est.minimum.solution.point.n_initial
    if k >= n:
        return {**row, "error": f"{k} unknowns, initial states counted, take up {n} real values"}
    alone = n / _together(reading.data)
    misfit = alone * np.log(max(est.cost, 1e-300) / n)
    return {
        **row,
        "parameters": parameters,
        "cost": est.cost,
        "fit_percent": est.fit_percent,
        "aic": misfit + 2 * k,
        "mdl": misfit + k * np.log(alone),
        "cross_validation": held_out / n,
        "converged": est.converged,
        "growing": any(w.kind == "unstable" and w.severity == "serious" for w in est.signs),
    }


def _together(data: object) -> float:
    """How many lines stand for one whose noise is its own: Σρ² over neighbours that share a window,
    of which the part that they share falls to nothing within its reach.
    """
    reach = data.reach if isinstance(data, FrequencyResponse) else 0
    shared = 1 - np.arange(1, reach + 1) / (reach + 1)
    return float(1 + 2 * (shared**2).sum())


def _cross_validation(est: Estimate, reading: Reading) -> float:
    """Cost of all lines, each as the fit to three quarters of the others foresees it.

    Lines that the input drives, and the others, are dealt out apart: those of a periodic input may
    be each fourth.
    """
    lines = reading.at_lines().lines(Plane()).lines
    energy = (np.abs(lines.U) ** 2).sum(axis=(0, 1)).reshape(len(lines.omega), -1).sum(axis=1)
    driven = energy > _DRIVEN * energy.mean()
    number = np.where(driven, np.cumsum(driven), np.cumsum(~driven))
    return sum(held_out_cost(est, reading, number % _FOLDS != fold) for fold in range(_FOLDS))
