"""Options that several commands share: how a file is read, which model is meant, and what is known.

Each group is a dataclass whose fields are options of the commands that take it.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter as Option

import freqid as fq
from freqid.checks import InputError
from freqid.cli.plants import model_of, pairs, texts, with_options
from freqid.data import ResponseFile
from freqid.lti import holds
from freqid.models import GreyBox

Band = Annotated[tuple[float, float] | None, Option(help="lowest and highest frequency in Hz")]
Between = Annotated[
    tuple[float, float] | None,
    Option(help="START STOP: only what lies between, in s from the first sample; inf for the end"),
]
Hold = Annotated[
    str | None,
    Option(
        help="what the input did between samples: zoh, foh or bl at the record's sample time, or "
        "zoh:PERIOD, foh:PERIOD in s, or estimate; by default what the record remembers"
    ),
]
Force = Annotated[
    bool, Option(help="overwrite files that are there already; never those that are read")
]
# options by their name as arguments, where that is another
RENAMED = {"input": "inputs", "output": "outputs"}
Group = Annotated[
    str | None, Option(help="which of several tables: an HDF5 group, a sheet, a structure")
]
Limits = list[tuple[str, float, float]] | None


def _several(text: str) -> Option:
    return Option(consume_multiple=True, help=text)


@Option(name="*")
@dataclass(frozen=True, kw_only=True)
class Reading:
    """How files are read: what ``freqid.read`` is told."""

    input: Annotated[list[str] | None, _several("columns that drove the plant")] = None
    output: Annotated[list[str] | None, _several("columns that were measured")] = None
    reference: Annotated[
        str | None,
        Option(help="column of what was commanded in a closed loop, through which the fit goes"),
    ] = None
    dt: Annotated[float | None, Option(help="sample time in s, of data without a time")] = None
    time: Annotated[str | None, Option(help="column of the time, where its name does not tell")] = (
        None
    )
    sep: Annotated[str | None, Option(help="what parts the cells of a text table")] = None
    decimal: Annotated[str | None, Option(help="its decimal sign")] = None
    columns: Annotated[list[str] | None, _several("names for a table that has none")] = None
    group: Group = None
    units: Annotated[
        list[str] | None, _several("NAME=UNIT of columns, such as time=ms torque='N m'")
    ] = None
    resample: Annotated[bool, Option(help="put jittered or missing samples on a regular grid")] = (
        False
    )

    def given(self) -> dict[str, Any]:
        """What was asked for, as arguments of ``freqid.read``."""
        asked = {f.name: getattr(self, f.name) for f in fields(self)}
        asked["units"] = texts("--units", self.units) or None
        return {RENAMED.get(k, k): v for k, v in asked.items() if v is not None and v is not False}

    def record(self, path: Path, between: tuple[float, float] | None = None) -> fq.Record:
        """The record of a file, or what ``--between`` leaves of it."""
        start, stop = ends(between)
        return fq.read(path, start=start, stop=stop, **self.given())

    def data(
        self, path: Path, between: tuple[float, float] | None = None
    ) -> fq.Record | fq.FrequencyResponse:
        """The record of a file, or the frequency response that an analyser wrote."""
        try:
            return self.record(path, between)
        except ResponseFile:
            if between is not None:
                raise InputError("--between is for records; a response has no samples") from None
            return self._response(path)

    def _response(self, path: Path) -> fq.FrequencyResponse:
        for option in ("reference", "time", "group", "resample"):
            if getattr(self, option):
                raise InputError(f"{path} holds a response; --{option} is for records")
        told: dict[str, Any] = {
            "sep": self.sep, "decimal": self.decimal, "columns": self.columns,
            "units": texts("--units", self.units) or None,
        }  # fmt: skip
        for option in ("input", "output"):
            asked = getattr(self, option)
            if asked is not None and len(asked) > 1:
                raise InputError(
                    f"--{option} {' '.join(asked)}: of a response one {option} is read, or all; "
                    "give one, or leave it out"
                )
            one = asked[0] if asked else None
            told[option] = int(one) if one and one.isdecimal() else one
        found = fq.read_response(path, **told)
        if self.dt is None:
            return found
        return type(found)(**{**found.__dict__, "dt": self.dt})


@Option(name="*")
@dataclass(frozen=True, kw_only=True)
class Asked:
    """Which model, and what is known of it."""

    model: Annotated[
        str,
        Option(
            help="two-mass (the paper's), three-mass, first-order, output-error (a black box of "
            "--order), transfer-function (--zeros, --poles), or your own: my_plant.py:plant "
            "(freqid new-model)"
        ),
    ]
    order: Annotated[int | None, Option(help="of output-error; by default 3")] = None
    zeros: Annotated[int | None, Option(help="of transfer-function; by default one less")] = None
    poles: Annotated[int | None, Option(help="of transfer-function; by default 3")] = None
    feedthrough: Annotated[bool, Option(help="output-error with a direct term")] = False
    stable: Annotated[bool, Option(help="output-error with its poles in the unit circle")] = False
    delay: Annotated[
        str | None, Option(help="transfer-function with a delay in s, or 'estimate'")
    ] = None
    fix: Annotated[
        list[str] | None,
        _several("parameters that keep their values, those of --start where it has them"),
    ] = None
    bounds: Annotated[Limits, Option(help="NAME LOW HIGH of the search")] = None
    prior: Annotated[Limits, Option(help="NAME MEAN STD that were known before")] = None
    start: Annotated[list[str] | None, _several("NAME=VALUE to begin from, as often as wanted")] = (
        None
    )

    def plant(self) -> object:
        """The model, fixed, bounded and believed in as was asked."""
        box = self.order, self.zeros, self.poles, self.feedthrough, self.stable, self.delay
        found = model_of(self.model, *box)
        kept = {*(self.fix or ()), *(name for name, *_ in self.bounds or ())}
        if isinstance(found, GreyBox) and kept:
            # what is fixed and begun from is fixed there, and a start lies inside its bounds
            found = found.with_values(**{n: v for n, v in self.values().items() if n in kept})
        return with_options(found, self.fix or (), self.bounds or (), self.prior or ())

    def grey_box(self) -> GreyBox:
        """The model; ValueError for one without parameters."""
        found = self.plant()
        if not isinstance(found, GreyBox):
            raise InputError(f"--model {self.model} is no grey box; give one with parameters")
        return found.with_values(**self.values())

    def values(self) -> dict[str, float]:
        """What ``--start`` says."""
        return pairs("--start", self.start)


@Option(name="*")
@dataclass(frozen=True, kw_only=True)
class Search:
    """How the fit is made: what ``freqid.fit`` is told."""

    hold: Hold = None
    band: Band = None
    weights: Annotated[
        str | None, Option(help="noise: weigh each line by the noise that the fit leaves there")
    ] = None
    offset: Annotated[bool, Option(help="make a constant of each output an unknown")] = False
    error: Annotated[
        str, Option(help="of responses: linear, or log where errors grow with their size")
    ] = "linear"
    loss: Annotated[str, Option(help="linear, or huber: samples that are far off count less")] = (
        "linear"
    )
    n_starts: Annotated[
        int | None, Option(help="how many starts to try; by default as many as it takes")
    ] = None

    def given(self) -> dict[str, Any]:
        """What differs from the usual, as arguments of ``freqid.fit``."""
        asked: dict[str, Any] = {
            "hold": hold_of(self.hold), "band": self.band, "weights": self.weights,
            "offset": "estimate" if self.offset else None, "n_starts": self.n_starts,
            "loss": None if self.loss == "linear" else self.loss,
            "error": None if self.error == "linear" else self.error,
        }  # fmt: skip
        return {k: v for k, v in asked.items() if v is not None}


def ends(between: tuple[float, float] | None) -> tuple[float | None, float | None]:
    """What ``--between`` leaves of a record: its start and its stop (s)."""
    if between is None:
        return None, None
    start, stop = between
    if not 0 <= start < stop:
        raise InputError(
            f"--between {start:g} {stop:g}: expected two times in s, the first one not below 0 and "
            "before the second one"
        )
    return start, None if math.isinf(stop) else stop


def hold_of(text: str | None) -> holds.Hold | str | None:
    """The hold that ``--hold`` names; a name alone is left to the record."""
    if text is None or text == "estimate":
        return text
    kind, told, period = text.partition(":")
    try:
        named = holds.Hold.named[kind]
        return named.at(float(period)) if told else text
    except (KeyError, ValueError):
        raise InputError(
            f"--hold {text} is not a hold; expected zoh, foh, bl, zoh:PERIOD or foh:PERIOD (s)"
        ) from None


def in_words(options: dict[str, Any]) -> str:
    """Arguments as they stand in a call, behind others: ``, inputs='u', dt=0.01``."""
    plain = {k: v[0] if isinstance(v, list) and len(v) == 1 else v for k, v in options.items()}
    return re.sub(r"^(?=.)", ", ", ", ".join(f"{k}={v!r}" for k, v in plain.items()))
