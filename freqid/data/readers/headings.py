"""Names and units of columns, as the rows above the samples tell them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from freqid.checks import InputError
from freqid.data.units import is_count, multiple

# units that loggers print beside those that have multiples
_UNIT = re.compile(
    r"s|ms|us|µs|ns|min|h|V|mV|A|mA|N|kN|N ?m|Nm|m|mm|rad|deg|°|rad/s|deg/s|rpm|m/s|m/s2|m/s\^2"
    r"|m/s²|g|Hz|Pa|kPa|MPa|hPa|mbar|bar|psi|K|°C|degC|°F|degF|%|counts?|kg|kg/s|kg/h|t/h|L/min"
    r"|l/min|L/h|l/h|L/s|l/s|m³/h|m3/h|m³/s|m3/s|gpm|kW"
)
# as oscilloscopes write units below the names of their channels
_SPOKEN = re.compile(r"(?i:seconds?|volts?|amps?|amperes?|hertz|watts?)")
# what Campbell's loggers call time stamps, and their unit
_STAMPS = "TIMESTAMP", "TS"
# rows that may stand between units and samples: of types, of descriptions
_BELOW = 2


def heading(rows: Sequence[Sequence[str]], width: int) -> tuple[list[str], dict[str, str], bool]:
    """Names and units from the rows above the samples, the last of as many cells as there are.

    ``x [mm]``, ``x (mm)`` and a row of units below that of names are understood, and one above
    them, or with a row or two of types and descriptions below it. A name may be there twice.
    """
    rows = [_with_brackets(r, width) for r in rows]
    full = [list(r) for r in rows if len(r) >= width and any(r)]
    full = [r[:width] for r in full if not any(r[width:])]
    near = range(2, width), range(width + 1, width + 3)
    if not full and rows and are_names(rows[-1]) and any(len(rows[-1]) in r for r in near):
        raise InputError(
            f"the samples have {width} cells and the line of names {len(rows[-1])}: "
            f"{', '.join(rows[-1])}; mend that line"
        )
    if not full:
        return [f"column{i + 1}" for i in range(width)], {}, False
    given, below = _names_and_units(full)
    names, units = [], {}
    for i, text in enumerate(given):
        name, unit = named(text or f"column{i + 1}")
        unit = below[i].strip("[]() ") if below and below[i].strip("[]()- ") else unit
        names.append(name)
        if unit:
            units[name] = unit
    for name in {n for n in names if names.count(n) > 1}:
        # V(in) and V(out) are names, and no volts
        units.pop(name, None)
        names = [t.strip() if n == name else n for n, t in zip(names, given, strict=True)]
    return names, units, True


def _names_and_units(full: Sequence[list[str]]) -> tuple[list[str], list[str]]:
    """The row of names among rows of as many cells, and that of units, empty where none is."""
    last = len(full) - 1
    for above, units in pairwise(full):
        if (above[0].upper(), units[0]) == _STAMPS and _are_distinct(above):
            # below them Campbell's loggers print of which kind the samples are: Avg
            return above, [u if is_a_unit(u) else "" for u in units]
    for at in range(last, max(last - _BELOW, 1) - 1, -1):
        units, above = full[at], full[at - 1]
        if not _are_units(units, above):
            continue
        # oscilloscopes have a row of units among their settings, each with its name in front
        if at == last or (is_a_unit(units[0].strip("[]() ")) and _are_distinct(above)):
            return above, units
    if last > 0 and _are_units(full[last - 1], full[last]) and _are_distinct(full[last]):
        # in front of those of settings stands what they are: "Unit"
        return full[last], [u if is_a_unit(u.strip("[]() ")) else "" for u in full[last - 1]]
    return full[last], []


def _are_distinct(cells: Sequence[str]) -> bool:
    return are_names(cells) and len(set(cells)) == len(cells)


def _with_brackets(cells: Sequence[str], width: int) -> Sequence[str]:
    """A row of more cells than there are columns with units in brackets behind their names, where
    spaces part both.
    """
    if len(cells) <= width:
        return cells
    joined: list[str] = []
    for cell in cells:
        if joined and re.fullmatch(r"[\[(].*[\])]", cell):
            joined[-1] += f" {cell}"
        else:
            joined.append(cell)
    return joined if len(joined) == width else cells


def named(text: str) -> tuple[str, str]:
    """A name and the unit in brackets behind it."""
    plain = text.strip()
    found = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", plain)
    if found and found[1] and not re.fullmatch(r"\d+", found[2]):
        # DIN 1338 and ISO 80000 write "v/(m/s)"
        return found[1].rstrip(" /"), found[2].strip() if found[2].strip() != "-" else ""
    other = re.fullmatch(r"(.+?)\s*(?:<([^<>]*)>|\{([^{}]*)\})", plain)
    if other and is_a_unit((other[2] or other[3] or "").strip()):
        return other[1], (other[2] or other[3]).strip()
    spoken = re.fullmatch(r"(.+?)\s+in\s+(.+)", plain)
    if spoken and is_a_unit(spoken[2]):
        return spoken[1], spoken[2]
    if is_a_unit(plain):
        return plain, ""
    for mark in re.finditer(r"\s*[/,]\s*", plain):
        name, unit = plain[: mark.start()], plain[mark.end() :]
        if name.endswith(" 1") and is_a_unit(f"1/{unit}"):
            # n 1/min
            name, unit = name[:-2].strip(), f"1/{unit}"
        if name and is_a_unit(unit):
            return name, unit
    return plain, ""


def is_a_unit(text: str) -> bool:
    """Whether a text is one of the units that loggers print."""
    return _UNIT.fullmatch(text) is not None or multiple(text) is not None or is_count(text)


def named_with(text: str, unit: str) -> str:
    """A name with its unit behind it, as ``named`` tells them apart."""
    return f"{text} [{unit or '-'}]" if unit or named(text) != (text, "") else text


def are_names(cells: Sequence[str]) -> bool:
    """Whether cells could be names of columns: words that begin with a letter."""
    return all(re.match(r"[^\W\d]", c) for c in cells)


def _are_units(cells: Sequence[str], above: Sequence[str]) -> bool:
    """Whether a row is one of units: brackets, or short words of which several are known, or one
    of them where nothing stands below the first name, as that of a time.
    """
    words = [c.strip() for c in cells if c.strip()]
    if all(re.fullmatch(r"[\[(].*[\])]", w) or w == "-" for w in words):
        return True
    known = sum(w == "-" or is_a_unit(w) or bool(_SPOKEN.fullmatch(w)) for w in words)
    enough = 1 if all(above) and not cells[0].strip() else 0.6 * len(words)
    return bool(words) and known >= enough
