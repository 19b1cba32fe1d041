"""What was set for one experiment: posture, load, temperature."""

from __future__ import annotations

from collections.abc import Mapping

from freqid.checks import finite, named_values


def as_conditions(values: Mapping[str, float] | None) -> dict[str, float]:
    """The conditions as numbers by name; ValueError for what is none."""
    given = named_values("conditions", values)
    return {str(name): finite(f"condition {name}", v) for name, v in given.items()}
