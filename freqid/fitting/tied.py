"""Tied parameters as an estimate has them: value and error follow from those of the free ones."""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING

from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

    from freqid.fitting.estimate import Estimate


def with_tied(free: pd.DataFrame, est: Estimate, half: float) -> pd.DataFrame:
    """The table of the free parameters with a row for each tied one under them.

    ``half`` is the half-width of an interval in standard errors. Left out is what follows one
    that each experiment has for itself and has no one value.
    """
    import pandas as pd

    if not isinstance(est.model, GreyBox):
        return free
    model = est.model
    apart = {n.partition("[")[0] for n in est.names} - {*est.names}
    began = dict(zip(est.names, est.nominal, strict=True))
    start = model.with_values(**{n: v for n, v in began.items() if n in model.values and v == v})
    units = {p.name: p.unit for p in model.parameters}
    rows = {}
    for name, expression in model.ties.items():
        if any(n in str(expression) for n in apart):
            continue
        value, std = map(float, est.derived(itemgetter(name)))
        rows[name] = [value, std, value - half * std, value + half * std, start[name], units[name]]
    tied = pd.DataFrame.from_dict(rows, orient="index", columns=list(free.columns))
    tied.index.name = free.index.name
    return pd.concat([free, tied]) if rows else free
