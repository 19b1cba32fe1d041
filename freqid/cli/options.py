"""Options that several commands have, and a hold as text."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter as Option

from freqid.checks import InputError
from freqid.lti import holds

Band = Annotated[tuple[float, float] | None, Option(help="lowest and highest frequency in Hz")]
Hold = Annotated[
    str | None,
    Option(
        help="what the input did between samples: zoh, foh or bl at the record's sample time, or "
        "zoh:PERIOD, foh:PERIOD in s, or estimate; by default what the record remembers"
    ),
]
Dt = Annotated[float | None, Option(help="sample time in s, for data without a time column")]
Texts = Annotated[list[str] | None, Option(consume_multiple=True)]
Limits = list[tuple[str, float, float]] | None
Columns = Annotated[list[str] | None, Option(consume_multiple=True)]


def hold_of(text: str | None) -> holds.Hold | str | None:
    """The hold that ``--hold`` names; a name alone is left to the record."""
    if text is None or ":" not in text:
        return text
    kind, _, period = text.partition(":")
    try:
        return holds.Hold.named[kind].at(float(period))
    except (KeyError, ValueError):
        raise InputError(
            f"--hold {text} is not a hold; expected zoh, foh, bl, zoh:PERIOD or foh:PERIOD (s)"
        ) from None
