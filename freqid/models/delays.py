"""What a grey box's argument ``input_delay`` means."""

from __future__ import annotations

from collections.abc import Container, Sequence

from freqid.checks import InputError, finite, listed, unknown

Delay = float | str


def given_delays(given: Delay | Sequence[Delay] | None) -> tuple[Delay, ...]:
    """The delays as given, in s or by the name of a parameter: none, one, or one for each input."""
    if given is None:
        return ()
    return (given,) if isinstance(given, (str, int, float)) else tuple(listed("input_delay", given))


def delay_names(given: Sequence[Delay], names: Sequence[str], tied: Container[str]) -> list[str]:
    """Parameters that are delays; ValueError for a delay that cannot be one."""
    for d in given:
        if not isinstance(d, str):
            finite("input_delay", d)
        elif d not in names:
            raise InputError(unknown("input_delay", d, names))
        elif d in tied:
            raise InputError(f"input_delay={d!r} is tied; tie the other parameter to it")
    return [d for d in given if isinstance(d, str)]
