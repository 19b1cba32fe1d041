"""Plants from mass, stiffness and damping matrices."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, InputError, an, choice, listed, named_values
from freqid.lti import StateSpace
from freqid.models.grey_box import GreyBox
from freqid.models.parameter import Parameter

# a matrix, or a function of parameters and conditions that returns one
MatrixLike = ArrayLike | Callable[..., Any]


def mechanical(
    M: MatrixLike,
    K: MatrixLike,
    D: MatrixLike | None = None,
    B: MatrixLike | None = None,
    C: MatrixLike | None = None,
    *,
    parameters: Sequence[Parameter],
    measured: Literal["position", "velocity", "acceleration"] = "position",
    conditions: Mapping[str, float] | None = None,
    name: str = "mechanical",
    **options: Any,
) -> GreyBox:
    """A GreyBox of M q'' + D q' + K q = B u, y = C q (or C q', or C q'').

    Args:
        M, K, D: mass, stiffness and damping, (n, n): matrices, or functions of those parameters
            and conditions that they name as arguments. No D is no damping.
        B: where inputs act, (n, inputs); none is a force on every coordinate.
        C: what is measured, (outputs, n), or (outputs, 2n) of positions and velocities together;
            none is every coordinate.
        parameters: the Parameter objects.
        measured: whether C takes positions, velocities or accelerations.
        conditions: names and usual values of what is set for each experiment.
        name, options: of the GreyBox.

    Raises ValueError for matrices of other shapes and, naming the values, where the mass matrix is
    not positive definite. States are q, then q'.

    Source: Wernholt and Moberg, Nonlinear gray-box identification using local models applied to
    industrial robots, Automatica 47, 2011.

    >>> import freqid as fq
    >>> arm = fq.mechanical(
    ...     lambda Jm, Ja: [[Jm, 0], [0, Ja]], lambda k: [[k, -k], [-k, k]],
    ...     lambda d: [[d, -d], [-d, d]], B=[[1], [0]], C=[[1, 0]], measured="velocity",
    ...     parameters=[fq.Parameter("Jm", 1.0), fq.Parameter("Ja", 2.0), fq.Parameter("k", 600.0),
    ...                 fq.Parameter("d", 0.5)])
    >>> (abs(arm.poles.imag).max() / 6.283185307).round(2)  # Hz
    np.float64(4.77)
    """
    choice("measured", measured, ("position", "velocity", "acceleration"))
    matrices = _Mechanical(
        _named("M", M), _named("K", K), _named("D", D), _named("B", B), _named("C", C), measured
    )
    parameters = [an("parameters", p, Parameter) for p in listed("parameters", parameters)]
    conditions = named_values("conditions", conditions)
    known = {p.name for p in parameters} | set(conditions)
    for letter, part in zip("MKDBC", matrices.parts, strict=True):
        if part is None:
            continue
        # what a default stands for is passed where it is meant by name
        part.names = tuple(n for n in part.names if n in known or n not in part.optional)
        for wanted in part.names:
            if wanted not in known:
                raise InputError(
                    f"{letter} is a function of {wanted!r}, which is neither a parameter nor a "
                    f"condition; those are {', '.join(sorted(known))}"
                )
    return GreyBox(matrices, parameters, conditions=conditions, name=name, **options)


# so small a part of the largest mass is none
_MASSLESS = 1e-15


class _Named:
    """A matrix as a function that is given all values and takes those that it names."""

    def __init__(self, letter: str, given: MatrixLike) -> None:
        self.letter, self.given = letter, given
        self.names: tuple[str, ...] = ()
        self.optional: frozenset[str] = frozenset()
        self.takes_all = False
        if callable(given):
            taken = list(inspect.signature(given).parameters.values())
            own = inspect.Parameter
            self.takes_all = any(p.kind is own.VAR_KEYWORD for p in taken)
            asked = own.KEYWORD_ONLY, own.POSITIONAL_OR_KEYWORD
            # what a partial has bound stays so
            bound = given.keywords if isinstance(given, functools.partial) else {}
            self.names = tuple(p.name for p in taken if p.kind in asked and p.name not in bound)
            self.optional = frozenset(p.name for p in taken if p.default is not p.empty)

    def near(self, values: Mapping[str, object], changed: set[str], before: Array) -> Array:
        """The matrix where only some values have changed since it was ``before``."""
        if not callable(self.given) or not (self.takes_all or changed.intersection(self.names)):
            return before
        return self(values)

    def __call__(self, values: Mapping[str, Any]) -> Array:
        if not callable(self.given):
            return np.atleast_2d(np.asarray(self.given, dtype=float))
        chosen = values if self.takes_all else {name: values[name] for name in self.names}
        kind = complex if any(np.iscomplexobj(v) for v in chosen.values()) else float
        # a copy: the function may fill the same array at every call
        return np.atleast_2d(np.array(self.given(**chosen), dtype=kind))


def _named(letter: str, given: MatrixLike | None) -> _Named | None:
    return None if given is None else _Named(letter, given)


class _Mechanical:
    """A, B, C, D of the matrices of mechanics; an object, so that it can be pickled."""

    def __init__(
        self,
        M: _Named | None,
        K: _Named | None,
        D: _Named | None,
        B: _Named | None,
        C: _Named | None,
        measured: str,
    ) -> None:
        self.parts, self.measured = (M, K, D, B, C), measured

    def __call__(self, **values: Any) -> StateSpace:
        M, K, D, B, C = (None if part is None else part(values) for part in self.parts)
        assert M is not None
        assert K is not None
        n = len(M)
        damping = np.zeros((n, n)) if D is None else D
        force = np.eye(n) if B is None else B
        for letter, X in (("M", M), ("K", K), ("D", damping)):
            if X.shape != (n, n):
                raise InputError(f"{letter} has shape {X.shape}; expected {(n, n)}, as M")
        if force.shape[0] != n:
            raise InputError(f"B has shape {force.shape}; expected ({n}, inputs)")
        seen = np.eye(n) if C is None else C
        if seen.shape[1] == 2 * n != n and self.measured != "position":
            raise InputError(
                f"measured={self.measured!r} beside C of shape {seen.shape}, which takes positions "
                f"and velocities already; give C (outputs, {n}), or leave measured out"
            )
        self._check_mass(M, values)
        if seen.shape[1] not in (n, 2 * n):
            raise InputError(f"C has shape {seen.shape}; expected (outputs, {n}) or (…, {2 * n})")
        return self._assembled(M, np.concatenate([K, damping, force], axis=1), seen)

    def near(
        self, values: Mapping[str, object], several: Sequence[Mapping[str, object]]
    ) -> StateSpace:
        """Matrices at ``several`` points near one, (S, …): most of what makes them stays."""
        before = [None if part is None else part(values) for part in self.parts]
        rows = []
        for moved in several:
            changed = {name for name, value in moved.items() if value != values[name]}
            rows.append([
                None if part is None or old is None else part.near(moved, changed, old)
                for part, old in zip(self.parts, before, strict=True)
            ])  # fmt: skip
        M, K, D, B, C = (
            None if column[0] is None else np.stack(column) for column in zip(*rows, strict=True)
        )
        assert M is not None
        assert K is not None
        eye = np.broadcast_to(np.eye(M.shape[-1]), M.shape)
        right = [K, np.zeros_like(M) if D is None else D, eye if B is None else B]
        return self._assembled(M, np.concatenate(right, axis=-1), eye if C is None else C)

    def _assembled(self, M: Array, right: Array, seen: Array) -> StateSpace:
        """State space of masses, [stiffness, damping, forces] and what is seen, (…, n, …)."""
        n = M.shape[-1]
        solved = np.linalg.solve(M, right)
        lead, m, p = M.shape[:-2], right.shape[-1] - 2 * n, seen.shape[-2]
        A = np.zeros((*lead, 2 * n, 2 * n), solved.dtype)
        A[..., :n, n:] = np.eye(n)
        A[..., n:, :] = -solved[..., : 2 * n]
        driven = np.zeros((*lead, 2 * n, m), solved.dtype)
        driven[..., n:, :] = solved[..., 2 * n :]
        direct = np.zeros((*lead, p, m), solved.dtype)
        if seen.shape[-1] == 2 * n:
            return StateSpace(A, driven, seen, direct)
        if self.measured == "acceleration":
            return StateSpace(A, driven, seen @ A[..., n:, :], seen @ driven[..., n:, :])
        place = slice(n, None) if self.measured == "velocity" else slice(n)
        output = np.zeros((*lead, p, 2 * n), seen.dtype)
        output[..., place] = seen
        return StateSpace(A, driven, output, direct)

    def _check_mass(self, M: Array, values: Mapping[str, Any]) -> None:
        """ValueError for a mass matrix that no machine has."""
        if not np.isfinite(M).all():
            raise InputError(f"the mass matrix M is not finite at {_where(values)}")
        if not np.allclose(M, M.T, rtol=1e-9, atol=1e-12 * float(np.abs(M).max(initial=0))):
            raise InputError("the mass matrix M is not symmetric; check its off-diagonal elements")
        masses = M.real.diagonal()
        try:
            np.linalg.cholesky(M.real)
            # a mass that rounding alone keeps from zero
            sound = bool(masses.min() > _MASSLESS * masses.max())
        except np.linalg.LinAlgError:
            sound = False
        if not sound:
            raise InputError(f"the mass matrix M is not positive definite at {_where(values)}")


def _where(values: Mapping[str, complex]) -> str:
    return ", ".join(f"{k}={np.real(v):g}" for k, v in values.items())
