"""Which order does a black box need: cost, criteria and cross-validation over DFT lines."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import choice, whole
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.fitting.black_box.output_error import cost_of, fit_black_box
from freqid.fitting.preparation import Options, prepare
from freqid.lti.holds.hold import Hold
from freqid.lti.responses import Plane
from freqid.lti.threads import in_one_blas_thread
from freqid.models.output_error import OutputError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

# every so-manyth line is held out in turn
_FOLDS = 4


@in_one_blas_thread
def select_order(
    data: Record | FrequencyResponse,
    orders: Iterable[int],
    *,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
    feedthrough: bool = False,
    initial_state: str = "estimate",
    criterion: str = "mdl",
) -> pd.DataFrame:
    """Fit OutputError of each order and compare.

    Columns: order, parameters, cost, fit_percent, aic, mdl, cross_validation and converged, one row
    for each order. AIC = n ln(V/n) + 2k, MDL = n ln(V/n) + k ln n with n real values and k
    parameters (Ljung, 1999, section 16.4); cross-validation is the cost per real value on each
    quarter of the lines of the model fitted to the other three. ``attrs["best"]`` is the order with
    the least ``criterion``: ``"aic"``, ``"mdl"`` or ``"cross_validation"``. Other arguments as in
    ``fit``. Raises ValueError for no orders, or one that is not a whole number.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.chirp(2, 40, 2, 1e-3), 1e-3).with_noise(0.01)
    >>> select_order(record, range(1, 4)).attrs["best"]
    1
    """
    import pandas as pd

    choice("criterion", criterion, ("aic", "mdl", "cross_validation"))
    wanted = [whole("orders", n) for n in orders]
    if not wanted:
        raise ValueError("orders is empty; give at least one, such as range(1, 7)")
    options = Options(hold, band, initial_state)
    shape = len(data.output_names or ()), len(data.input_names or ())
    lines = prepare(data, shape, None, options, Plane())[0].n_lines  # type: ignore[attr-defined]
    rows = []
    for order in wanted:
        spec = OutputError(order, feedthrough)
        est = fit_black_box(spec, [data], [None], options)
        n, k = est.n_rows, len(est.values)
        misfit = n * np.log(max(est.cost, 1e-300) / n)
        held_out = 0.0
        for fold in range(_FOLDS):
            out = np.arange(lines) % _FOLDS == fold
            trained = fit_black_box(spec, [data], [np.where(out, 0.0, 1.0)], options)
            held_out += cost_of(trained.model, data, np.where(out, 1.0, 0.0), options)
        rows.append(
            {
                "order": order,
                "parameters": k,
                "cost": est.cost,
                "fit_percent": est.fit_percent,
                "aic": misfit + 2 * k,
                "mdl": misfit + k * np.log(n),
                "cross_validation": held_out / n,
                "converged": est.converged,
            }
        )
    table = pd.DataFrame(rows)
    table.attrs["best"] = int(table["order"].to_numpy()[table[criterion].argmin()])
    table.attrs["criterion"] = criterion
    return table


def plot_orders(table: pd.DataFrame, ax: Axes | None = None) -> Axes:
    """Criteria against order, each less its least value; the best order is marked.

    Takes the table of ``select_order`` and returns the axes.
    """
    import matplotlib.pyplot as plt

    from freqid.plots.style import context, line

    with context():
        if ax is None:
            _, ax = plt.subplots()
        n = np.exp((table["mdl"] - table["aic"]) / table["parameters"] + 2).iloc[0]
        curves: dict[str, Any] = {
            "AIC": table["aic"],
            "MDL": table["mdl"],
            "cross-validation": n * np.log(table["cross_validation"]),
        }
        for index, (name, values) in enumerate(curves.items()):
            ax.plot(
                table["order"], values - values.min() + 1, marker="o", label=name, **line(index)
            )
        ax.axvline(table.attrs["best"], color="#999999", linewidth=0.8, zorder=0)
        ax.set(xlabel="order", ylabel="criterion, less its least value, + 1", yscale="log")
        ax.set_xticks(table["order"])
        ax.legend()
    return ax
