"""Ready-made plants: the first-order lag and the two-mass axis of the paper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from freqid.models import GreyBox, Parameter


def first_order(b: float = 100, a: float = 100) -> GreyBox:
    """b / (s + a), the paper's eq. 1: gain b in 1/s, pole at −a rad/s.

    Raises ValueError for values that are not finite.

    >>> first_order().values
    {'b': 100.0, 'a': 100.0}
    """
    return GreyBox(
        _first_order,
        [Parameter("b", b, unit="1/s"), Parameter("a", a, unit="rad/s")],
        name="first order",
        vectorized=True,
    )


def two_mass(
    Jm: float = 9e-4,
    k: float = 1.5e5,
    Ja: float = 11,
    fm: float = 1e-3,
    d: float = 10,
    gear: float = 1 / 118,
) -> GreyBox:
    """Motor and arm joined by a flexible gear: the paper's eq. 9-11 with Table 1's values.

    Input: motor torque (N m). Output: motor velocity (rad/s). States: twist of the gear, motor
    velocity, arm velocity. Jm and Ja are inertias (kg m²), k the stiffness (N m/rad), d the
    damping of the gear and fm the friction of the motor (N m s/rad); the gear ratio is fixed.
    Raises ValueError for values that are not finite.

    >>> [p.name for p in two_mass().free_parameters]
    ['Jm', 'k', 'Ja', 'fm', 'd']
    """
    return GreyBox(
        _two_mass,
        [
            Parameter("Jm", Jm, unit="kg m²"),
            Parameter("k", k, unit="N m/rad"),
            Parameter("Ja", Ja, unit="kg m²"),
            Parameter("fm", fm, unit="N m s/rad"),
            Parameter("d", d, unit="N m s/rad"),
            Parameter("gear", gear, unit="1", fixed=True),
        ],
        inputs=["torque"],
        outputs=["velocity"],
        name="two-mass",
        vectorized=True,
    )


def _first_order(b: Any, a: Any) -> tuple[Any, ...]:
    return _stack([[-a]]), _stack([[b]]), _stack([[1 + 0 * a]]), _stack([[0 * a]])


def _two_mass(Jm: Any, k: Any, Ja: Any, fm: Any, d: Any, gear: Any) -> tuple[Any, ...]:
    zero, one, r = 0 * k, 1 + 0 * k, gear
    return (
        _stack(
            [
                [zero, r, -one],
                [-r * k / Jm, -(fm + r**2 * d) / Jm, r * d / Jm],
                [k / Ja, d * r / Ja, -d / Ja],
            ]
        ),
        _stack([[zero], [one / Jm], [zero]]),
        _stack([[zero, one, zero]]),
        _stack([[zero]]),
    )


def _stack(rows: list[list[Any]]) -> Any:
    """A matrix of scalars, or of equally long arrays with their axis moved to the front."""
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


PLANTS: dict[str, Callable[[], GreyBox]] = {"first-order": first_order, "two-mass": two_mass}
