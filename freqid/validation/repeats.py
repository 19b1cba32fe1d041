"""The same fit once more: with another hold, without one repeat, with repeats drawn again."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from freqid.checks import InputError, an, flag, processes, whole
from freqid.data import Bar, DataSet, Record, as_data_sets, in_turn
from freqid.fitting import (
    Estimate,
    Near,
    Weights,
    check_options,
    fit,
    known_options,
    uninterrupted,
)
from freqid.models import GreyBox
from freqid.validation.comparison import compare

if TYPE_CHECKING:
    import pandas as pd


# repeats from which on resamples scatter about as they should
_ENOUGH = 10
# what goes to ``fit``
Options = Mapping[str, Any]


def hold_bias(
    est: Estimate,
    data: Record | Sequence[Record],
    *,
    band: tuple[float, float] | None = None,
    weights: Weights | Sequence[Weights] = None,
) -> pd.DataFrame:
    """The bias bar: what the assumed hold has added to each parameter, to modes of a black box.

    The model of ``est`` is fitted to the same ``data`` with the hold that the records remember, in
    the ``band`` and with the ``weights`` of the estimate where none are given; ``bias`` is the
    estimate less that, to be drawn beside ``std``, the error bar of the noise. Columns estimate,
    remembered, bias and std; the ratio of bias to std says which of the two rules. Coefficients of
    a black box mean another thing under another hold, so that there the rows are frequency (Hz) and
    damping of its modes in turn.
    """
    import pandas as pd

    an("est", est, Estimate)
    if any("[" in n for n in est.names) and isinstance(est.model, GreyBox):
        raise InputError("hold_bias knows no parameters that each experiment has for itself")
    band = est.band if band is None else band
    weights = est.weights if weights is None else weights
    if not isinstance(est.model, GreyBox):
        spec = est.model.spec
        if "delay" in est.names:
            spec = dataclasses.replace(spec, delay="estimate")
        remembered = fit(spec, data, band=band, weights=weights)
        columns = _mode_values(est), _mode_values(remembered)
    else:
        nominal = dict(zip(est.names, est.nominal, strict=True))
        usable = {n: v for n, v in nominal.items() if n in est.model.values and np.isfinite(v)}
        remembered = fit(est.model.with_values(**usable), data, band=band, weights=weights)
        columns = est.parameters, remembered.parameters
    own, other = columns
    names = [n for n in own.index if n in other.index]
    own, other = own.loc[names], other.loc[names]
    return pd.DataFrame(
        {
            "estimate": own["value"],
            "remembered": other["value"],
            "bias": own["value"] - other["value"],
            "std": own["std"],
        },
        index=pd.Index(names, name="parameter"),
    )


def _mode_values(est: Estimate) -> pd.DataFrame:
    """Frequency and damping of each mode, value and std, under names that count them."""
    import pandas as pd

    rows = {}
    for number, mode in enumerate(est.modes().to_dict("records"), 1):
        for what in ("frequency", "damping"):
            # a real pole's damping is no estimate
            if np.isnan(mode[f"{what}_std"]):
                continue
            rows[f"{what} {number}"] = (mode[what], mode[f"{what}_std"])
    return pd.DataFrame.from_dict(rows, orient="index", columns=["value", "std"])


def cross_validate(
    model: object,
    records: Sequence[Record],
    *,
    n_jobs: int | None = None,
    progress: bool = False,
    **options: Any,
) -> pd.DataFrame:
    """Fit a model to all repeats but one, and compare with that one, each in turn.

    ``options`` go to ``fit``. ``n_jobs`` is a number of processes (extra ``parallel``), None this
    one, or what ``joblib.parallel_config`` says (``backend="dask"`` for a cluster); with
    ``progress`` the screen shows how many are done. Returns a
    DataFrame with one row a repeat: ``held_out``, the fit in per cent of each output, and the
    parameters. Raises ValueError for fewer than two records.
    """
    import pandas as pd

    sets = _repeats(model, records, options)
    if len(sets) < 2:
        raise InputError(f"records holds {len(sets)}; cross-validation needs two or more repeats")
    processes(n_jobs)
    work = partial(_held_out, model, sets, options)
    with Bar(flag("progress", progress), len(sets), 0, "repeats held out") as advance:
        rows = in_turn(work, range(len(sets)), n_jobs, lambda _: advance(1))
    return pd.DataFrame(rows)


def _held_out(
    model: object, sets: Sequence[DataSet], options: Options, i: int
) -> dict[str, object]:
    """A row: what the fit to all repeats but one explains of that one."""
    est = _fitted(model, sets, options, [k for k in range(len(sets)) if k != i])
    fits = compare(est, sets[i]).fit_percent
    named = {f"fit {n}": float(v) for n, v in zip(sets[i].output_names, fits, strict=True)}
    return {"held_out": i, **named, **_values(est)}


def bootstrap(
    model: object,
    records: Sequence[Record],
    n: int = 200,
    seed: int = 0,
    *,
    n_jobs: int | None = None,
    progress: bool = False,
    **options: Any,
) -> pd.DataFrame:
    """Estimates from repeats drawn again with replacement: their scatter without a noise model.

    ``options`` go to ``fit``, a list of weights with its records; ``seed`` is that of the ``n``
    resamples, each of which starts from the estimate of all repeats. ``n_jobs`` is a number of
    processes (extra ``parallel``), None this one, or what ``joblib.parallel_config`` says
    (``backend="dask"`` for a cluster), with the same numbers; with ``progress`` the screen shows
    how many are done. Returns a DataFrame (n, parameters) whose ``describe`` and ``quantile`` give
    error bars; NaN where all that were drawn know a parameter by their conditions. Few repeats
    scatter less than they say: ``attrs["note"]`` of fewer than ten tells by how much their
    intervals are too narrow. Raises ValueError for fewer than three records.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 6.
    """
    import pandas as pd

    sets, count = _repeats(model, records, options), whole("n", n)
    processes(n_jobs)
    if len(sets) < 3:
        raise InputError(f"records holds {len(sets)}; a bootstrap needs three or more repeats")
    flag("progress", progress)
    rng = np.random.default_rng(whole("seed", seed, least=0))
    whole_fit = fit(model, sets, **options)
    uninterrupted(whole_fit.message)
    if hasattr(whole_fit.model, "values"):
        free = [p.name for p in whole_fit.model.free_parameters]
        options = {**options, "start": Near({k: whole_fit[k] for k in free}), "n_starts": 1}
    drawn = [tuple(sorted(rng.integers(0, len(sets), len(sets)).tolist())) for _ in range(count)]
    # few repeats have few resamples: of four there are 35, in whatever order they were drawn
    each = list(dict.fromkeys(drawn))
    work, times = partial(_drawn_again, model, sets, options), Counter(drawn)
    with Bar(progress, count, 0, "resamples") as advance:
        values = in_turn(work, each, n_jobs, lambda i: advance(times[each[i]]))
    known = dict(zip(each, values, strict=True))
    columns = list(_values(whole_fit))
    table = pd.DataFrame([known[d] for d in drawn], columns=columns)
    if len(sets) < _ENOUGH:
        table.attrs["note"] = _narrow(len(sets))
    return table


def _narrow(repeats: int) -> str:
    """By how much intervals from resamples of few repeats are too narrow, in words: their
    scatter is √((n − 1)/n) of the mean's own, which follows Student's t.
    """
    degrees = repeats - 1
    times = np.sqrt(repeats / degrees) * scipy.stats.t.ppf(0.975, degrees) / 1.96
    return (
        f"{repeats} repeats: intervals of 95 % from these resamples are about {times:.2g} times "
        "too narrow (the square root of n/(n - 1), and Student's t); take more repeats, or the "
        "error bars of fit"
    )


def _drawn_again(
    model: object, sets: Sequence[DataSet], options: Options, which: Sequence[int]
) -> dict[str, float]:
    """The estimate from some of the repeats, some of them more than once."""
    return _values(_fitted(model, sets, options, which))


def _repeats(
    model: object, records: Sequence[Record] | Mapping[str, Record], options: Options
) -> list[DataSet]:
    """The repeats; ValueError for options that no fit to some of them could take."""
    if options.get("separate"):
        raise InputError(
            f"separate={options['separate']!r}: a parameter of each experiment for itself says "
            "nothing of another one; leave separate out"
        )
    check_options(model, known_options("option", fit, options))
    return list(as_data_sets(list(records.values()) if isinstance(records, Mapping) else records))


def _fitted(
    model: object, sets: Sequence[DataSet], options: Options, which: Sequence[int]
) -> Estimate:
    """The fit to some of the repeats, each with the weights that are its own."""
    weights, start = options.get("weights"), options.get("start")
    if isinstance(weights, (list, tuple)) and len(weights) == len(sets):
        options = {**options, "weights": [weights[i] for i in which]}
    if isinstance(start, Near):
        # what all of these know by their conditions is no unknown of theirs
        known = set.intersection(*(set(sets[i].conditions) for i in which))
        options = {**options, "start": Near({n: v for n, v in start.items() if n not in known})}
    est = fit(model, [sets[i] for i in which], **options)
    uninterrupted(est.message)
    return est


def _values(est: Estimate) -> dict[str, float]:
    """All that was estimated, tied parameters too."""
    return dict(est.parameters["value"])
