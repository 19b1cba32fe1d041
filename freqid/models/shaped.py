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
    found = np.array(0 if name == "D" and M is None else M)
    if dtype is float and np.iscomplexobj(found):
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
        found = f"{len(matrices)} items" if isinstance(matrices, Sized) else f"{matrices!r:.60}"
        raise InputError(f"matrices returned {found}; expected A, B, C, D")
    try:
        shapes = [np.asarray(M, dtype=complex).shape for M in matrices if M is not None]
    except (TypeError, ValueError):
        raise InputError("matrices returned rows of unlike length, or no numbers") from None
    shapes = [np.asarray(M).shape for M in matrices]
    text = f"matrices returned shapes A {shapes[0]}, B {shapes[1]}, C {shapes[2]}, D {shapes[3]}"
    expected = "expected (n, n), (n, inputs), (outputs, n), (outputs, inputs)"
    if any(len(shape) != 2 for shape in shapes[:3]):
        raise InputError(f"{text}; {expected}")
    out = StateSpace(*as_dense(matrices, float))
    n, m, p = out.A.shape[0], out.B.shape[1], out.C.shape[0]
    wanted = ((n, n), (n, m), (p, n), (p, m))
    if any(M.shape != shape for M, shape in zip(out, wanted, strict=True)):
        raise InputError(f"{text}; {expected}")
    if not all(np.isfinite(M).all() for M in out):
        at = ", ".join(f"{k}={v:g}" for k, v in values.items())
        raise InputError(f"matrices are not finite at {at}; change the values or the function")
    return out
