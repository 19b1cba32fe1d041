"""Tables of a report: parameters, modes, what lies between parts of the data, residual tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from freqid.checks import InputError
from freqid.fitting import Estimate, of_error, rounded
from freqid.pages.report.figures import records
from freqid.validation import residual_test

if TYPE_CHECKING:
    import pandas as pd

# rows of a table that a page can carry
_ROWS = 500
# correlations of this size leave two parameters hard to tell apart
_CORRELATED = 0.9


class Table(NamedTuple):
    """A table's cells, and how many rows are left out of it."""

    columns: list[str]
    rows: list[list[str]]
    left_out: int


def parameters(est: Estimate, bias: Mapping[str, float]) -> Table:
    """The parameters with their error bars, and bias bars where there are any."""
    columns = ["parameter", "value", "±", "95 % from", "to", "nominal", "unit"]
    if bias:
        columns.insert(3, "bias")
    rows = []
    for name, p in est.parameters.head(_ROWS).iterrows():
        value, lower, upper = (_rounded(p[c], p["std"]) for c in ("value", "lower", "upper"))
        row = [str(name), value, _error(p["std"]), lower, upper, _number(p["nominal"], 6),
               str(p["unit"])]  # fmt: skip
        if bias:
            row.insert(3, _number(bias.get(str(name), np.nan), 3))
        rows.append(row)
    return Table(columns, rows, max(len(est.names) - _ROWS, 0))


def _rounded(x: float, std: float) -> str:
    """To the digits that its error leaves."""
    return rounded(x, std) if np.isfinite(x) else _number(x, 2)


def _error(std: float) -> str:
    return of_error(std) if np.isfinite(std) else _number(std, 2)


def _number(x: float, digits: int) -> str:
    if np.isnan(x):
        return ""
    return "∞" if np.isposinf(x) else "−∞" if np.isneginf(x) else f"{x:.{digits}g}"


def tests(est: Estimate) -> list[dict[str, object]]:
    """The residual tests on the first record, a row each."""
    if not records(est):
        return []
    try:
        table = residual_test(est, records(est)[0], band=est.band)
    except InputError:
        return []
    return [
        {
            "test": row["test"],
            "channels": f"{row['output']} and {row['input']}" if row["input"] else row["output"],
            "statistic": f"{row['statistic']:.3g}",
            "limit": f"{row['limit']:.3g}",
            "p": f"{row['p_value']:.2g}",
            "passed": bool(row["passed"]),
        }
        for row in table.to_dict("records")
    ]


def modes(est: Estimate) -> Table:
    """Frequency and damping of each mode, or the time constant of a real pole."""
    columns = ["mode", "frequency in Hz", "±", "damping ratio, or time constant", "±",
               "pole in rad/s"]  # fmt: skip
    found = est.modes()
    rows = []
    for i, (_, mode) in enumerate(found.head(_ROWS).iterrows()):
        row = [f"{i + 1}{_outside(mode)}"]
        real = bool(np.isfinite(mode["time_constant"]))
        for n in ("frequency", "time_constant" if real else "damping"):
            value, std = float(mode[n]), float(mode[f"{n}_std"])
            unit = " s" if n == "time_constant" else ""
            told = _rounded(value, std) if std > 0 else _number(value, 6)
            row += [f"{told}{unit}", _error(std)]
        rows.append([*row, _pole(float(mode["frequency"]), float(mode["damping"]))])
    return Table(columns, rows, max(len(found) - _ROWS, 0))


def _pole(frequency: float, damping: float) -> str:
    """The pole of a mode, a pair of them with both signs, in continuous time."""
    if np.isnan(damping):
        return "0"
    size = 2 * np.pi * frequency
    real, imaginary = -damping * size, size * np.sqrt(max(1 - damping**2, 0.0))
    return f"{real:.4g}" + (f" ± {imaginary:.5g}j" if imaginary > 1e-9 * size else "")


def _outside(mode: pd.Series) -> str:
    """What is said of a mode that the data did not reach."""
    return "" if mode.get("in_band", True) else ", outside the band"


def spread(est: Estimate) -> Table:
    """How far the numbers move between parts of the data."""
    columns = ["between", "parameter", "difference in %", "in its ±", "p", "±", "± widened"]
    found = est.spread
    if found.empty:
        return Table(columns, [], 0)
    found = found[found["shift"].notna()]
    rows = [
        [row["between"], row["parameter"], _number(row["percent"], 3), _number(row["shift"], 3),
         _number(row["p_value"], 2), _error(row["std"]), _error(row["widened"])]
        for row in found.head(_ROWS).reset_index().to_dict("records")
    ]  # fmt: skip
    return Table(columns, rows, max(len(found) - _ROWS, 0))


def correlations(est: Estimate) -> Table:
    """Pairs of parameters that the data hardly tell apart, the closest first."""
    if len(est.names) > _ROWS:
        return Table([], [], len(est.names))
    C = est.correlation.to_numpy()
    pairs = np.argwhere(np.triu(np.abs(C) > _CORRELATED, 1))
    pairs = pairs[np.argsort(-np.abs(C[pairs[:, 0], pairs[:, 1]]), kind="stable")]
    rows = [[est.names[i], est.names[j], f"{C[i, j]:.4f}"] for i, j in pairs[:_ROWS]]
    return Table(["parameter", "and", "correlation"], rows, max(len(pairs) - _ROWS, 0))
