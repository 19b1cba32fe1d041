"""``bias_map``: the bias of every parameter over spectra, decimation factors, holds and plants."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.bias.apparent import Sampling, weight_of
from freqid.bias.conditions import Conditions
from freqid.bias.map_rows import Answer, Row, answer_chunk
from freqid.checks import Array, InputError, flag, listed, named_values, path_of, processes, whole
from freqid.data import Bar, as_band, unordered
from freqid.excitation import ChirpSpectrum, InputSpectrum
from freqid.fitting import TableStore
from freqid.lti import Hold, PeriodicHold, ZeroOrderHold, as_hold, known_hold
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

_CHUNK = 64
_OTHER = "a map of other plants, spectra, factors or holds"


def bias_map(
    plant: GreyBox | Mapping[str, GreyBox],
    spectra: Mapping[str, InputSpectrum],
    factors: Iterable[int],
    holds: Iterable[Hold | str | None] = ("zoh", "foh", None),
    base_dt: float | None = None,
    *,
    true_hold: Hold | None = None,
    band: tuple[float, float] | None = None,
    antialias: bool = False,
    prefilter: Any = None,
    noise_model: Any = None,
    path: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool | None = None,
    chunk: int = _CHUNK,
) -> pd.DataFrame:
    """Asymptotic estimates for every combination, without data: one row for each parameter.

    Args:
        plant: the true plant and the model at once, or several by name.
        spectra: of the input as the converter holds it, by name.
        factors: one sample in so many is kept.
        holds: that the fit assumes: names mean a hold at the slow rate, None the true one.
        base_dt: sample time of the input in s; by default the period of ``true_hold``.
        true_hold: what the converter does; None for a zero-order hold at ``base_dt``.
        band, antialias, prefilter, noise_model: as in ``asymptotic_fit``.
        path: of a .parquet file. What is finished is kept beside it; the same call takes an
            interrupted map up again, and reads a finished one.
        n_jobs: processes, through joblib; ``joblib.parallel_config(backend="dask")`` around the
            call runs the map on a cluster.
        progress: a bar on standard error; by default where that is a terminal.
        chunk: fits that advance together.

    Returns a DataFrame with the columns spectrum, factor, hold, parameter, true, estimate,
    relative_bias = (estimate − true)/|true|, cost, converged and message; and plant, first, where
    several were given. The remembered hold is called "remembered". A row that fails is one with
    ``converged`` False and a message. Raises ValueError for empty arguments or a factor that is
    not a whole number.

    >>> import freqid as fq
    >>> table = bias_map(fq.two_mass(), {"10-80": fq.ChirpSpectrum(10, 80)}, [10], ["zoh", None],
    ...                  base_dt=0.5e-3)
    >>> table.query("parameter == 'd'")["estimate"].round(2).tolist()
    [-231.44, 10.0]
    """

    plants = {"": plant} if isinstance(plant, GreyBox) else named_values("plant", plant)
    sampling, rows = _asked(plants, spectra, factors, holds, base_dt, true_hold)
    as_band(band)
    path = None if path is None else path_of("path", path)
    sampling = dataclasses.replace(sampling, antialias=flag("antialias", antialias))
    processes(n_jobs)
    if progress is not None:
        flag("progress", progress)
    # each row puts its own spectrum and factor in
    shared = Conditions(rows[0].spectrum, sampling, band, prefilter, noise_model)
    chunks = _chunks(rows, whole("chunk", chunk))
    store = (
        None if path is None else TableStore(path, _identity(plants, rows, shared, chunk), _OTHER)
    )
    finished = None if store is None else store.whole()
    if finished is not None:
        return finished[0]
    tables: dict[int, pd.DataFrame] = {}
    with store or nullcontext():
        if store is not None:
            tables = {n: table for n, table, _ in store.chunks()}
        todo = [n for n in range(len(chunks)) if n not in tables]
        jobs = [
            (n, plants[rows[chunks[n][0]].plant_label], [rows[i] for i in chunks[n]]) for n in todo
        ]
        done = sum(len(chunks[n]) for n in tables)
        with Bar(progress, len(rows), done, "bias map") as advance:
            for _, (n, answers) in unordered(partial(_work, shared=shared), jobs, n_jobs):
                model = plants[rows[chunks[n][0]].plant_label]
                tables[n] = _table(model, chunks[n], [rows[i] for i in chunks[n]], answers)
                if store is not None:
                    store.keep(n, tables[n])
                advance(len(answers))
        table = _whole(tables, isinstance(plant, GreyBox), spectra)
        if store is not None:
            store.finish(table)
    return table


def _whole(
    tables: Mapping[int, pd.DataFrame], single: bool, spectra: Mapping[str, InputSpectrum]
) -> pd.DataFrame:
    """The chunks as one table, of a ``single`` plant or of several."""
    import pandas as pd

    table = pd.concat([tables[n] for n in sorted(tables)], ignore_index=True)
    table = table.sort_values("row", kind="stable", ignore_index=True).drop(columns="row")
    if single:
        table = table.drop(columns="plant")
    table.attrs["upper_frequency"] = {
        name: float(s.high) for name, s in spectra.items() if isinstance(s, ChirpSpectrum)
    }
    return table


def _asked(
    plants: Mapping[str, GreyBox],
    spectra: Mapping[str, InputSpectrum],
    factors: Iterable[int],
    holds: Iterable[Hold | str | None],
    base_dt: float | None,
    true_hold: Hold | None,
) -> tuple[Sampling, list[Row]]:
    """The checked arguments as rows, spectra running fastest: neighbours resemble one another."""
    for name, model in plants.items():
        if not isinstance(model, GreyBox):
            raise InputError(f"plant {name!r} is a {type(model).__name__}; expected a GreyBox")
        if not model.free_parameters:
            raise InputError("plant has no free parameter; free one with plant.free(name)")
    if not isinstance(spectra, Mapping):
        raise InputError("spectra must be a mapping from names to spectra, {'10-80': ...}")
    for name, spectrum in spectra.items():
        if not isinstance(spectrum, InputSpectrum):
            raise InputError(f"spectra[{name!r}] is a {type(spectrum).__name__}, not a spectrum")
    counts = [whole("factors", f) for f in listed("factors", factors)]
    assumed = [holds] if isinstance(holds, (str, Hold)) else listed("holds", holds)
    for what, given in (("plant", plants), ("spectra", spectra)):
        if not given:
            raise InputError(f"{what} is empty; give at least one")
    if not counts or not assumed:
        raise InputError("factors and holds must hold at least one entry each")
    if true_hold is None:
        if base_dt is None:
            raise InputError("base_dt is missing; give the sample time of the input in s")
        true_hold = ZeroOrderHold(base_dt)
    known_hold("true_hold", true_hold)
    if base_dt is None:
        if not isinstance(true_hold, PeriodicHold):
            raise InputError(
                "base_dt is missing; a band-limited input has no period to take it from"
            )
        base_dt = true_hold.period
    for hold in assumed:
        if isinstance(hold, str) and hold == "estimate":
            raise InputError("holds contains 'estimate'; a map compares holds that are assumed")
        as_hold(hold, base_dt, true_hold)
    rows = [
        Row(plant, name, hold_label(hold), factor, spectrum, hold)
        for plant in plants
        for hold in assumed
        for factor in counts
        for name, spectrum in spectra.items()
    ]
    return Sampling(true_hold, base_dt, 1), rows


def hold_label(hold: Hold | str | None) -> str:
    """What the table calls an assumed hold."""
    if hold is None:
        return "remembered"
    return hold if isinstance(hold, str) else repr(hold)


def _chunks(rows: Sequence[Row], size: int) -> list[list[int]]:
    """Numbers of the rows that advance together: of one plant and one assumption."""
    groups: dict[tuple[str, str], list[int]] = {}
    for i, row in enumerate(rows):
        groups.setdefault((row.plant_label, row.hold_label), []).append(i)
    return [
        group[start : start + size]
        for group in groups.values()
        for start in range(0, len(group), size)
    ]


Job = tuple[int, GreyBox, list[Row]]


def _work(job: Job, shared: Conditions) -> tuple[int, list[Answer]]:
    number, model, rows = job
    return number, answer_chunk(model, rows, shared)


def _table(
    model: GreyBox, numbers: Sequence[int], rows: Sequence[Row], answers: Sequence[Answer]
) -> pd.DataFrame:
    import pandas as pd

    names = [p.name for p in model.free_parameters]
    true = np.array([p.value for p in model.free_parameters])
    P = len(names)
    estimate = np.array([a.values for a in answers])
    with np.errstate(divide="ignore", invalid="ignore"):
        bias = np.where(true == 0, np.nan, (estimate - true) / np.abs(true))

    def each(values: Sequence[object]) -> Array:
        return np.repeat(np.array(values), P)

    return pd.DataFrame(
        {
            "row": each(numbers),
            "plant": each([r.plant_label for r in rows]),
            "spectrum": each([r.spectrum_label for r in rows]),
            "factor": each([r.factor for r in rows]),
            "hold": each([r.hold_label for r in rows]),
            "parameter": np.tile(names, len(rows)),
            "true": np.tile(true, len(rows)),
            "estimate": estimate.ravel(),
            "relative_bias": bias.ravel(),
            "cost": each([a.cost for a in answers]),
            "converged": each([a.converged for a in answers]),
            "message": each([a.message for a in answers]),
        }
    )


def _identity(
    plants: Mapping[str, GreyBox], rows: Sequence[Row], shared: Conditions, chunk: int
) -> str:
    """A fingerprint of what is asked: plants by matrices and slopes, spectra by their values."""
    seen, s = hashlib.sha256(), shared.sampling
    base_dt = s.base_dt
    for name, model in plants.items():
        free = [(p.name, p.lower, p.upper) for p in model.free_parameters]
        seen.update(repr((name, free)).encode())
        lin = model.linearise(model.values, [p.name for p in model.free_parameters])
        for matrix in (*lin.at, *lin.derivative):
            seen.update(np.ascontiguousarray(matrix).tobytes())
    f = np.linspace(0, 0.5 / base_dt, 97)
    for spectrum in {r.spectrum_label: r.spectrum for r in rows}.values():
        try:
            dt = base_dt
            for array in (spectrum.density(f, dt), spectrum.edges(dt), *spectrum.lines(dt)):
                seen.update(np.ascontiguousarray(array).tobytes())
        except InputError as error:
            seen.update(str(error).encode())
    for row in rows:
        labels = (row.plant_label, row.spectrum_label, row.hold_label, row.factor)
        seen.update(repr(labels).encode())
    for factor in sorted({row.factor for row in rows}):
        dt = base_dt * factor
        weight = weight_of(f / factor, dt, shared.prefilter, shared.noise_model)
        seen.update(weight.tobytes())
    seen.update(repr((s.hold, base_dt, shared.band, s.antialias, chunk)).encode())
    return seen.hexdigest()
