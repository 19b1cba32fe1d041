"""Which order does a black box need: cost, criteria and cross-validation over DFT lines."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, choice, whole
from freqid.data import FrequencyResponse, Record
from freqid.fitting.black_box.output_error import cost_of, fit_output_error
from freqid.fitting.noise_models import GivenWeights
from freqid.fitting.reading import Reading
from freqid.lti import Hold, Plane, in_one_blas_thread
from freqid.models import OutputError

if TYPE_CHECKING:
    import pandas as pd

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
        raise InputError("orders is empty; give at least one, such as range(1, 7)")
    reading = Reading.of(data, hold, band, initial_state=initial_state)  # type: ignore[arg-type]
    lines = np.arange(reading.at_lines().lines(Plane()).n_lines)
    rows = []
    for order in wanted:
        spec = OutputError(order, feedthrough)
        est = fit_output_error(spec, [reading])
        n, k = est.n_rows, len(est.values)
        misfit = n * np.log(max(est.cost, 1e-300) / n)
        held_out = 0.0
        for fold in range(_FOLDS):
            out = lines % _FOLDS == fold
            kept, left_out = (reading.with_(noise=GivenWeights(1.0 * m)) for m in (~out, out))
            held_out += cost_of(fit_output_error(spec, [kept]).model, left_out)
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
