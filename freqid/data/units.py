"""Units of channels: kept by name, and the quotient of two as a label prints it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from freqid.checks import InputError, named_values, unknown


def as_units(
    given: Mapping[str, str] | None, names: Sequence[str], others: Sequence[str] = ()
) -> dict[str, str]:
    """Units by channel; ValueError for a name that is neither a channel nor one of ``others``."""
    for name in named_values("units", given):
        if name not in (*names, *others):
            raise InputError(unknown("units", name, names))
    return {str(name): str(unit) for name, unit in (given or {}).items()}


def quotient(of: str, by: str) -> str:
    """The unit of a response; empty where neither end has one.

    >>> quotient("rad/s", "N m"), quotient("m", ""), quotient("", "")
    ('(rad/s)/(N m)', 'm', '')
    """
    if of == by or not (of or by):
        # what has the unit of its input is a plain number
        return ""
    return _bracketed(of or "1") + (f"/{_bracketed(by)}" if by else "")


def _bracketed(unit: str) -> str:
    return f"({unit})" if re.search(r"[\s/·*]", unit) else unit


# turns a minute in German, French, Dutch, Italian, Polish, Czech, Swedish and Russian
_TURNS = ("UPM", "Umdr/min", "Umdr./min", "/min", "min⁻¹", "tr/min", "tr/mn", "trs/min",
          "omw/min", "omw./min", "toeren/min", "giri/min", "obr/min", "ot/min", "varv/min",
          "об/мин")  # fmt: skip
# what a logger writes, by the coherent unit that it is a multiple of, and that
_OTHERS = {
    "rad": {"°": np.pi / 180, "deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180,
            "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6, "rev": 2 * np.pi, "turn": 2 * np.pi,
            "turns": 2 * np.pi},
    "rad/s": {"rpm": np.pi / 30, "krpm": 1e3 * np.pi / 30,
              "1/min": np.pi / 30, "r/min": np.pi / 30, "U/min": np.pi / 30,
              "rev/min": np.pi / 30, "min^-1": np.pi / 30, "min-1": np.pi / 30,
              "rev/s": 2 * np.pi, "°/s": np.pi / 180, "deg/s": np.pi / 180,
              "deg/sec": np.pi / 180, "dps": np.pi / 180, "mrad/s": 1e-3, "Hz": 2 * np.pi,
              "rps": 2 * np.pi, "r/s": 2 * np.pi, "rev/sec": 2 * np.pi, "tr/s": 2 * np.pi,
              **dict.fromkeys(_TURNS, np.pi / 30)},
    "N m": {"mNm": 1e-3, "mN m": 1e-3, "Nmm": 1e-3, "N mm": 1e-3, "Ncm": 1e-2, "N cm": 1e-2,
            "kNm": 1e3, "kN m": 1e3, "lbf ft": 1.3558179, "ft lbf": 1.3558179, "lb ft": 1.3558179,
            "ft lb": 1.3558179, "lbf in": 0.11298483, "in lbf": 0.11298483, "kgf m": 9.80665,
            "kgf cm": 0.0980665, "kgfcm": 0.0980665, "kg cm": 0.0980665, "oz in": 7.0615518e-3,
            "ozf in": 7.0615518e-3},
    "N": {"mN": 1e-3, "kN": 1e3, "lbf": 4.4482216, "kgf": 9.80665, "gf": 9.80665e-3},
    "m": {"mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6, "in": 0.0254, "inch": 0.0254,
          "ft": 0.3048, "mil": 2.54e-5, "mils": 2.54e-5, "thou": 2.54e-5, "nm": 1e-9},
    "m/s": {"mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1 / 3.6, "kph": 1 / 3.6, "kmh": 1 / 3.6,
            "mph": 0.44704},
    "m/s^2": {"mm/s^2": 1e-3, "cm/s^2": 1e-2, "mm/s²": 1e-3, "cm/s²": 1e-2, "mm/s2": 1e-3,
              "cm/s2": 1e-2, "g": 9.80665, "gn": 9.80665, "g_n": 9.80665, "g0": 9.80665,
              "mg": 9.80665e-3, "Gal": 1e-2, "mGal": 1e-5, "in/s^2": 0.0254, "in/s²": 0.0254,
              "in/s2": 0.0254, "ft/s^2": 0.3048, "ft/s²": 0.3048, "ft/s2": 0.3048},
    "A": {"mA": 1e-3, "uA": 1e-6, "µA": 1e-6, "kA": 1e3},
    "V": {"mV": 1e-3, "uV": 1e-6, "µV": 1e-6, "kV": 1e3},
    "W": {"mW": 1e-3, "kW": 1e3, "MW": 1e6, "BTU/h": 0.29307107, "hp": 745.69987},
    "K": {"mK": 1e-3, "°F": 1 / 1.8, "degF": 1 / 1.8},
    "Pa": {"hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": 1e5, "psi": 6894.757},
    "m^3/s": {"l/s": 1e-3, "L/s": 1e-3, "l/min": 1e-3 / 60, "L/min": 1e-3 / 60, "lpm": 1e-3 / 60,
              "l/h": 1e-3 / 3600, "m³/h": 1 / 3600, "m^3/h": 1 / 3600, "m3/h": 1 / 3600},
}  # fmt: skip


# units of times, rates and plain numbers
_TIMED = re.compile(r"|1|%|m?s|k?Hz|(1|rad)/s(²|\^2)?")
# how the unit of a parameter has that of a channel in it, a moment of inertia N m s²/rad
_INERTIA = r"kg\s*m(²|\^2|2)"
_LENGTH = r"/\s*\(?m\b|kg(?!\s*m)|^m(/s)?/|^m([²³]|\^[23])|s/m([²³]|\^[23])"
# resistances, inductances and capacities, which have volts and amperes in them
_CIRCUIT = r"(?<![A-Za-z])(Ω|ohms?|Ohms?|H|F|Wb)\b|Ω"
_MENTIONS = {
    "rad": rf"rad|{_INERTIA}", "rad/s": rf"rad|{_INERTIA}",
    "N m": rf"N\s*m|{_INERTIA}", "N": r"N(?!\s*m)|kg(?!\s*m)", "m": _LENGTH, "m/s": _LENGTH,
    "m/s^2": _LENGTH, "m^3/s": rf"{_LENGTH}|m³", "A": rf"A\b|{_CIRCUIT}",
    "V": rf"V\b|{_CIRCUIT}", "W": r"(?<![A-Za-z])W\b",
    "K": r"(?<![A-Za-z])K\b", "Pa": r"(?<![A-Za-z])Pa\b",
}  # fmt: skip
# those that mean one thing however they are written
_ANY_CASE = {
    other.casefold(): (base, factor)
    for base in ("rad", "rad/s") for other, factor in _OTHERS[base].items()
}  # fmt: skip
# what a converter counts, which are no multiples of anything that is known here
_COUNTS = {"count", "counts", "cnt", "cnts", "lsb", "lsbs", "tick", "ticks", "bit", "bits", "inc"}
# units that names end in: angle_deg, speed_rpm; x_cm may be the centre of mass
_ENDS = {"deg", "rpm", "mrad", "mNm", "Nmm", "Ncm", "mm", "mA", "dps", "counts", "ticks", "psi",
         "mbar"}  # fmt: skip
# those that no other capitals spell: u_MV is a manipulated variable
_SPELLED_ENDS = {"mV", "kV", "kN", "kPa", "kW", "krpm", "kgf"}


def coherent(unit: str) -> tuple[str, float] | None:
    """The coherent unit of which one is a multiple, and that; None for all others.

    >>> coherent("mNm"), coherent("rad")
    (('N m', 0.001), None)
    """
    plain = re.sub(r"[·*]", " ", unit).strip()
    # a hyphen parts factors, but not an exponent
    parted = re.sub(r"(?<=[A-Za-z])-(?=[A-Za-z])", " ", plain)
    for written in (plain, parted):
        for base, others in _OTHERS.items():
            if written in others:
                return base, others[written]
    return _ANY_CASE.get(plain.casefold())


def multiple(unit: str) -> tuple[str, float] | None:
    """The same, and 1 for a unit that is a coherent one; None for what is neither.

    >>> multiple("mNm"), multiple("rad")
    (('N m', 0.001), ('rad', 1.0))
    """
    spelled = _spelled(unit)
    return coherent(unit) or ((spelled, 1.0) if spelled in _OTHERS else None)


def unlike(one: str, other: str) -> bool:
    """Whether two units are multiples of one another; False for what is not known to be.

    >>> unlike("mm", "m"), unlike("deg", "rad"), unlike("V", "N"), unlike("m/s²", "m/s^2")
    (True, True, False, False)
    """
    (base, size), (same, scale) = (coherent(u) or (_spelled(u), 1.0) for u in (one, other))
    return base == same and abs(size / scale - 1) > 1e-6


def _spelled(unit: str) -> str:
    """A unit as the coherent ones are written here."""
    return re.sub(r"(?<=s)2$", "^2", re.sub(r"[·*]", " ", unit).replace("²", "^2").strip())


def is_of_time(unit: str) -> bool:
    """Whether a unit has that of no channel in it: times, rates and plain numbers.

    >>> is_of_time("rad/s"), is_of_time("rad/s/V")
    (True, False)
    """
    return _TIMED.fullmatch(unit) is not None


def mentions(unit: str, base: str) -> bool:
    """Whether the unit of a parameter has the ``base`` of a channel's in it, as an inertia has rad.

    >>> mentions("kg m²", "rad/s"), mentions("rad/s/V", "rad/s"), mentions("rad/s", "rad/s")
    (True, True, False)
    """
    return not is_of_time(unit) and re.search(_MENTIONS[base], unit) is not None


def meant(unit: str, base: str) -> tuple[str, float] | None:
    """The unit of a channel that the unit of a parameter has in it, and that in the coherent one,
    the ``base``; None where it has none of that kind.

    >>> meant("rad/s/V", "rad/s"), meant("mm/V", "m"), meant("rad/s/V", "m")
    (('rad/s', 1.0), ('mm', 0.001), None)
    """
    if mentions(unit, base):
        return base, 1.0
    parts = {p for p in re.split(r"[\s/·*()]+", unit) if p in _OTHERS[base]}
    return next(((p, _OTHERS[base][p]) for p in parts), None) if len(parts) == 1 else None


def is_share(unit: str) -> bool:
    """Whether a unit is a part of something whose size it does not tell.

    >>> is_share("%"), is_share("V")
    (True, False)
    """
    return unit.strip().casefold() in ("%", "percent", "pct")


def units_of_channels(names: Sequence[str], units: Mapping[str, str]) -> list[tuple[str, str]]:
    """Channels and their units, of those that have one or whose name ends in one.

    >>> units_of_channels(["torque", "angle_deg"], {"torque": "N m"})
    [('torque', 'N m'), ('angle_deg', 'deg')]
    """
    told = [(name, units.get(name) or unit_in_name(name)) for name in names]
    return [(name, unit) for name, unit in told if unit]


def is_count(unit: str) -> bool:
    """Whether a unit is that of a converter's numbers.

    >>> is_count("LSB"), is_count("V")
    (True, False)
    """
    return unit.strip().casefold() in _COUNTS


def unit_in_name(name: str) -> str:
    """The unit that a name ends in; empty where that is none.

    >>> unit_in_name("angle_deg"), unit_in_name("Speed RPM"), unit_in_name("torque")
    ('deg', 'rpm', '')
    """
    end = re.split(r"[_\s]+", name.strip())[-1]
    if end == name or (coherent(end) is None and not is_count(end)):
        return ""
    if end in _SPELLED_ENDS:
        return end
    return next((u for u in _ENDS if end in (u, u.upper(), u.capitalize())), "")
