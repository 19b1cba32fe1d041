"""Filters in any of the shapes in which they are given, and their gain in power."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Union

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, FloatArray, InputError

if TYPE_CHECKING:
    import control

# a control system, polynomials (b, a) in z, or a function of omega (rad/s)
Filter = Union["control.lti.LTI", tuple[ArrayLike, ArrayLike], Callable[[FloatArray], ArrayLike]]


def power_gain(system: Filter, frequency: ArrayLike, dt: float) -> FloatArray:
    """|H|² of a control system, a tuple (b, a) in z, or a function of ω (rad/s).

    Raises ValueError for a discrete system of another sample time, or several channels.
    """
    f = np.asarray(frequency, dtype=float)
    omega = 2 * np.pi * f
    if isinstance(system, tuple) and len(system) == 2:
        z = np.exp(1j * omega * dt)
        H: Array = np.polyval(np.asarray(system[0]), z) / np.polyval(np.asarray(system[1]), z)
    elif hasattr(system, "ninputs"):
        H = _response(system, omega.ravel(), dt).reshape(f.shape)
    elif callable(system):
        H = np.asarray(system(omega))
    else:
        raise _no_filter(system)
    return np.abs(H) ** 2


def known_filter(system: Filter) -> None:
    """ValueError for what is no filter."""
    pair = isinstance(system, tuple) and len(system) == 2
    if not (pair or hasattr(system, "ninputs") or callable(system)):
        raise _no_filter(system)


def _no_filter(system: object) -> InputError:
    return InputError(
        f"system={type(system).__name__} is no filter; expected a control system, a tuple "
        "(b, a) of polynomials in z, or a function of omega (rad/s)"
    )


def _response(system: control.lti.LTI, omega: FloatArray, dt: float) -> Array:
    if (system.ninputs, system.noutputs) != (1, 1):
        raise InputError(f"system has {system.ninputs} inputs and {system.noutputs} outputs")
    # control's True is a discrete system of any sample time, None a system of any time
    discrete = system.dt is True or (system.dt is not None and system.dt > 0)
    if discrete and system.dt is not True and not np.isclose(system.dt, dt, rtol=1e-9):
        raise InputError(f"system has dt={system.dt:g} s; the sequence has {dt:g} s")
    s = np.exp(1j * omega * dt) if discrete else 1j * omega
    return np.asarray(system(s, squeeze=True))
