"""Several files as one stream: logs that begin a new file every hour, or at every gibibyte."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from glob import glob
from itertools import pairwise
from pathlib import Path

from freqid.checks import Array, InputError, unknown
from freqid.data.stream_found import Found, Source
from freqid.data.stream_times import seconds_between

# part of a sample time that a file may begin too early or too late
_SHIFT = 0.5


def files_of(source: Source) -> list[Path]:
    """The files that a path, a pattern or several paths name, in order; none for anything else.

    Those of a pattern are in the order of their names, 2 before 10. Raises FileNotFoundError for a
    pattern without files, ValueError for a file that comes twice or for no files.
    """
    if isinstance(source, (str, Path)):
        pattern = str(source)
        if Path(source).exists() or not re.search(r"[*?\[]", pattern):
            return [Path(source)]
        files = sorted((Path(name) for name in glob(pattern, recursive=True)), key=_by_number)
        if not files:
            raise FileNotFoundError(f"{pattern}: no file has such a name; check the path")
        return files
    if not isinstance(source, (list, tuple)):
        return []
    if not source:
        raise InputError("source is empty; give at least one file, or blocks of samples")
    if not all(isinstance(each, (str, Path)) for each in source):
        return []
    files = [Path(each) for each in source]
    if twice := [file for file in files if files.count(file) > 1]:
        raise InputError(f"{twice[0]} is given twice; a stream reads each file once")
    return files


def chained(each: Sequence[Found], wanted: Sequence[str] | None, held: bool) -> Found:
    """Files that follow one another as one; ValueError where they do not.

    ``wanted`` are the channels that all have to have, those of the first where that is not said;
    ``held`` says that the hold is given, whatever they remember.
    """
    first = each[0]
    if len(each) == 1:
        return first
    names = first.names if wanted is None else list(dict.fromkeys(wanted))
    for name in names:
        if name not in first.names:
            raise InputError(f"{first.origin}: {unknown('channel', name, first.names)}")
    for other in each[1:]:
        _check_channels(other, names, first, held)
    # a file without a row has no time that could follow on, and hides no gap
    filled = [found for found in each if found.n_samples != 0]
    step = next((f.clock.step for f in filled if f.clock and f.clock.step), None)
    for before, after in pairwise(filled):
        _check_follows(before, after, step)
    lengths = [found.n_samples or 0 for found in each]
    starts = [sum(lengths[:i]) for i in range(len(each))]

    def blocks(begin: int, which: Sequence[int]) -> Iterator[Array]:
        asked = [names[i] for i in which]
        for found, start, length in zip(each, starts, lengths, strict=True):
            if begin < start + length:
                own = [found.names.index(name) for name in asked]
                yield from found.blocks(max(begin - start, 0), own)

    origin = f"{len(each)} files from {first.origin} to {each[-1].origin}"
    units = {name: unit for found in reversed(each) for name, unit in found.units.items() if unit}
    dt = next((found.dt for found in each if found.dt), None)
    return Found(
        blocks, names, sum(lengths), dt, origin, first.hold, first.conditions, units,
        lost=next((found.lost for found in each if found.lost), ""),
        aliased=max(found.aliased for found in each),
        slow=frozenset().union(*(found.slow for found in each)),
        notes=tuple(dict.fromkeys(note for found in each for note in found.notes)),
        by_name=any(found.by_name for found in each),
        hollow={n: told for found in each for n, told in found.hollow.items()},
    )  # fmt: skip


def _check_channels(found: Found, names: Sequence[str], first: Found, held: bool) -> None:
    missing = [name for name in names if name not in found.names]
    if missing:
        raise InputError(
            f"{found.origin} has no channel {missing[0]!r}, as {first.origin} has; name inputs and "
            f"outputs that all have (it has {', '.join(found.names)})"
        )
    told: list[tuple[str, object, object]] = [
        ("hold", None if held else found.hold, None if held else first.hold),
        ("conditions", dict(found.conditions), dict(first.conditions)),
        ("units", _known(found.units, names), _known(first.units, names)),
    ]
    for what, own, others in told:
        if own != others:
            raise InputError(
                f"{found.origin} tells other {what} than {first.origin}: {own} and {others}; open "
                "each by itself"
            )


def _known(units: Mapping[str, str], names: Sequence[str]) -> dict[str, str]:
    return {name: units[name] for name in names if units.get(name)}


def _check_follows(before: Found, after: Found, step: float | None) -> None:
    """ValueError for sample times that differ, or a gap of another ``step`` (s)."""
    if before.dt is not None and after.dt is not None and abs(after.dt / before.dt - 1) > 1e-6:
        raise InputError(
            f"{after.origin} has a sample time of {after.dt:g} s and {before.origin} of "
            f"{before.dt:g} s; open each by itself"
        )
    if before.clock is None or after.clock is None or step is None:
        return
    off = seconds_between(before.clock, after.clock) - step
    if abs(off) > _SHIFT * step:
        what = f"{off:g} s are missing" if off > 0 else f"{-off:g} s are there twice"
        raise InputError(
            f"between {before.origin} and {after.origin} {what}, as their times say; open what "
            "follows on by itself, or give dt in s where the samples are even all the same"
        )


def _by_number(path: Path) -> list[tuple[int, str | int]]:
    """Numbers within names count as numbers."""
    parts = re.split(r"(\d+)", str(path))
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]
