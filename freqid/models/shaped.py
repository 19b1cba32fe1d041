"""What a user's function returned, as matrices of agreeing shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Sized

import numpy as np

from freqid.checks import Array, InputError
from freqid.lti import StateSpace


def as_dense(matrices: Sequence[object], dtype: type) -> list[Array]:
    """A, B, C, D as arrays of their own; D may be nothing, or a number.

    Raises ValueError for complex numbers where real ones are wanted.
    """
    A, B, C, D = (_numbers(name, M, dtype) for name, M in zip("ABCD", matrices, strict=True))
    if D.ndim == 0:
        D = np.full((C.shape[0], B.shape[1]), D, dtype)
    return [A, B, C, D]


def _numbers(name: str, M: object, dtype: type) -> Array:
    """A copy, for a function may fill the same arrays at every call."""
    found = np.asarray(0 if name == "D" and M is None else M)
    if dtype is float and found.dtype.kind == "c":
        if found.imag.any():
            raise InputError(
                f"matrices returned complex numbers in {name}; expected real ones: write a pair "
                "of poles p, p* as [[p.real, p.imag], [-p.imag, p.real]]"
            )
        found = found.real
    return found.astype(dtype)


def shaped(matrices: Sequence[object], values: Mapping[str, float]) -> StateSpace:
    """Dense, finite matrices of agreeing shapes, or a ValueError that shows the shapes."""
    if not isinstance(matrices, (Sequence, np.ndarray)) or len(matrices) != 4:
        what = f"{len(matrices)} items" if isinstance(matrices, Sized) else f"{matrices!r:.60}"
        raise InputError(f"matrices returned {what}; expected A, B, C, D")
    try:
        found = [np.asarray(0.0 if M is None else M) for M in matrices]
        for M in found:
            if M.dtype.kind not in "fiubc":
                M.astype(complex)
    except (TypeError, ValueError):
        raise InputError("matrices returned rows of unlike length, or no numbers") from None
    if any(M.ndim != 2 for M in found[:3]):
        raise _unlike(found)
    out = StateSpace(*as_dense(found, float))
    n, m, p = out.A.shape[0], out.B.shape[1], out.C.shape[0]
    wanted = ((n, n), (n, m), (p, n), (p, m))
    if any(M.shape != shape for M, shape in zip(out, wanted, strict=True)):
        raise _unlike(found)
    if not all(np.isfinite(M).all() for M in out):
        at = ", ".join(f"{k}={v:g}" for k, v in values.items())
        raise InputError(f"matrices are not finite at {at}; change the values or the function")
    return out


def _unlike(found: Sequence[Array]) -> InputError:
    """What to say of shapes that do not agree."""
    told = ", ".join(f"{name} {M.shape}" for name, M in zip("ABCD", found, strict=True))
    return InputError(
        f"matrices returned shapes {told}; expected (n, n), (n, inputs), (outputs, n), "
        "(outputs, inputs)"
    )
