"""A user's function of parameters as matrices, and the matrices' exact derivatives."""

from __future__ import annotations

import copy
import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np

from freqid.checks import FloatArray, InputError, State
from freqid.lti import Linearisation, StateSpace
from freqid.models.portable import arrived, carried
from freqid.models.shaped import as_dense, shaped
from freqid.models.ties import Ties

Matrices = Callable[..., Sequence[object]]
Jacobian = Callable[..., Mapping[str, Sequence[object]]]

# small enough that its square vanishes beside any matrix entry
_COMPLEX_STEP = 1e-100
# a user's derivative is off from differences by no more than this part
_AGREES = 1e-3


class KnowsNeighbours(Protocol):
    """Matrices whose function takes many points near one at less than their sum."""

    def near(
        self, values: Mapping[str, object], several: Sequence[Mapping[str, object]]
    ) -> StateSpace:
        """Matrices at ``several`` points, (S, …), each near ``values``."""
        ...


def without(function: Matrices, names: Sequence[str]) -> Matrices:
    """The function of parameters of which it does not take some."""
    if not callable(function):
        raise InputError(
            f"matrices={function!r:.80} is no function; expected one of parameters that returns "
            "A, B, C and D"
        )
    if not names:
        return function
    taken = inspect.signature(function).parameters
    if any(p.kind is p.VAR_KEYWORD for p in taken.values()):
        return function
    left_out = tuple(name for name in names if name not in taken)
    return _Without(function, left_out) if left_out else function


@dataclass(frozen=True)
class _Without:
    function: Matrices
    names: tuple[str, ...]

    def __call__(self, **values: object) -> Sequence[object]:
        return self.function(**{k: v for k, v in values.items() if k not in self.names})


class MatrixFunction:
    """A, B, C, D and their derivatives at parameter values, ties resolved.

    ``vectorized`` says that the function takes arrays of values; ``jacobian`` gives the derivatives
    where the user has them; at the ``nominal`` values it is tried whether complex steps do.
    """

    def __init__(
        self,
        matrices: Matrices,
        ties: Ties,
        vectorized: bool,
        jacobian: Jacobian | None,
        nominal: Mapping[str, float],
        conditions: Mapping[str, float],
    ) -> None:
        self.matrices, self.ties, self.nominal = matrices, ties, nominal
        self.vectorized, self.jacobian, self.conditions = vectorized, jacobian, conditions
        self._carries: dict[tuple[str, ...], bool] = {}
        self._believed: set[tuple[str, ...]] = set()

    def __getstate__(self) -> State:
        """What a pickle takes: functions that no module holds by their code."""
        return carried(self.__dict__, "matrices", "jacobian")

    def __setstate__(self, state: State) -> None:
        """Restore; what version 0.1.0 wrote lacks what it did not know."""
        self.__dict__.update({"conditions": {}} | arrived(state))

    @property
    def _apart(self) -> tuple[str, ...]:
        """Parameters that the matrices do not take: delays."""
        return self.matrices.names if isinstance(self.matrices, _Without) else ()

    def under(self, conditions: Mapping[str, float]) -> MatrixFunction:
        """The same function where other conditions are set."""
        other = copy.copy(self)
        other.conditions = conditions
        return other

    def _matrices(self, values: Mapping[str, object]) -> Sequence[object]:
        return self.matrices(**values, **self.conditions)

    def at(self, values: Mapping[str, float]) -> StateSpace:
        """Dense, finite matrices of agreeing shapes; ValueError where there are none."""
        resolved = self.ties.resolve(values)
        try:
            matrices = self._matrices(resolved)
        except Exception as error:  # the user's function may raise anything
            where = ", ".join(f"{k}={v:g}" for k, v in {**resolved, **self.conditions}.items())
            # a KeyError says no more than a name
            bare = isinstance(error, LookupError | TypeError | AttributeError)
            told = f"{type(error).__name__}: {error}" if bare else str(error)
            raise InputError(f"the model cannot be computed at {where}: {told}") from error
        return shaped(matrices, resolved)

    def linearise(self, values: Mapping[str, float], names: Sequence[str]) -> Linearisation:
        """Matrices at ``values`` and their derivatives by the parameters ``names``.

        A complex step (Squire and Trapp, SIAM Review 40, 1998) gives the derivative to rounding;
        where the user's function does not carry complex numbers through, central differences.
        """
        if self.vectorized and self.jacobian is None:
            columns = np.array(list(values.values()), dtype=float)[:, None]
            at, derivative = self._complex_batch(list(values), columns, names)
            return Linearisation(
                StateSpace(*(M[0] for M in at)), StateSpace(*(M[0] for M in derivative))
            )
        resolved = self.ties.resolve(values)
        at = shaped(self._matrices(resolved), resolved)
        if self.jacobian is not None:
            self._check_jacobian(names)
            return Linearisation(at, self._by_jacobian(at, values, names))
        exact = self.takes_complex(names)
        return Linearisation(at, self._differentiate(at, values, names, exact))

    def _by_jacobian(
        self, at: StateSpace, values: Mapping[str, float], names: Sequence[str]
    ) -> StateSpace:
        """The user's derivatives, carried through the ties by the chain rule."""
        assert self.jacobian is not None
        by = self.jacobian(**self.ties.resolve(values), **self.conditions)
        total = [np.zeros((len(names), *M.shape)) for M in at]
        for i, name in enumerate(names):
            moved = self.ties.resolve({**values, name: values[name] + _COMPLEX_STEP * 1j})
            for other, value in moved.items():
                slope = np.imag(value) / _COMPLEX_STEP
                if slope == 0 or other in self._apart:
                    continue
                if other not in by:
                    raise InputError(f"jacobian returned no derivative by {other!r}")
                for part, d in zip(total, by[other], strict=True):
                    part[i] += slope * np.asarray(0.0 if d is None else d, dtype=float)
        return StateSpace(*total)

    def _check_jacobian(self, names: Sequence[str]) -> None:
        """ValueError for a user's derivatives that differences of the matrices contradict."""
        key = tuple(names)
        if key in self._believed:
            return
        at = self.at(self.nominal)
        given = self._by_jacobian(at, self.nominal, names)
        rough = self._differentiate(at, self.nominal, names, by_complex_step=False)
        for letter, a, b in zip("ABCD", given, rough, strict=True):
            size = np.maximum(np.abs(b), np.abs(a)).max(axis=(1, 2), initial=0)
            off = np.abs(a - b).max(axis=(1, 2), initial=0) > _AGREES * size
            if off.any():
                name = names[int(np.argmax(off))]
                raise InputError(
                    f"jacobian: the derivative of {letter} by {name!r} is not that of the "
                    "matrices; mend it, or leave jacobian out: derivatives are exact without one"
                )
        self._believed.add(key)

    def linearise_many(
        self, values: Mapping[str, float], points: FloatArray, names: Sequence[str]
    ) -> Linearisation:
        """Matrices (S, …) at many points (S, len(names)) and their derivatives (S, P, …)."""
        if self.vectorized and self.jacobian is None:
            columns = np.tile(np.array(list(values.values()), dtype=float)[:, None], len(points))
            for name, column in zip(names, points.T, strict=True):
                columns[list(values).index(name)] = column
            return Linearisation(*self._complex_batch(list(values), columns, names))
        each = [
            self.linearise({**values, **dict(zip(names, row.tolist(), strict=True))}, names)
            for row in points
        ]
        at, derivative = zip(*each, strict=True)
        return Linearisation(
            StateSpace(*(np.stack(M) for M in zip(*at, strict=True))),
            StateSpace(*(np.stack(M) for M in zip(*derivative, strict=True))),
        )

    def _complex_batch(
        self, names: Sequence[str], columns: FloatArray, by: Sequence[str]
    ) -> tuple[StateSpace, StateSpace]:
        """Matrices at S points, columns (len(names), S), and derivatives, in one call."""
        S, count = columns.shape[1], len(by)
        stacked = np.empty((len(names), S, count + 1), complex)
        stacked[:] = columns[..., None]
        row = {name: i for i, name in enumerate(names)}
        for i, name in enumerate(by):
            stacked[row[name], :, i + 1] += _COMPLEX_STEP * 1j
        flat = dict(zip(names, stacked.reshape(len(names), -1), strict=True))
        matrices = [
            np.asarray(M).reshape(S, count + 1, *np.asarray(M).shape[1:])
            for M in self._matrices(self.ties.resolve(flat))
        ]
        return (
            StateSpace(*(M[:, 0].real for M in matrices)),
            StateSpace(*(M[:, 1:].imag / _COMPLEX_STEP for M in matrices)),
        )

    def _differentiate(
        self,
        at: StateSpace,
        values: Mapping[str, float],
        names: Sequence[str],
        by_complex_step: bool,
    ) -> StateSpace:
        columns = []
        # asking a protocol would take as long as a plant's matrices
        if by_complex_step and names and hasattr(self.matrices, "near"):
            near = [
                {**self.ties.resolve({**values, n: values[n] + _COMPLEX_STEP * 1j}),
                 **self.conditions}
                for n in names
            ]  # fmt: skip
            known = cast(KnowsNeighbours, self.matrices)
            moved = known.near({**self.ties.resolve(values), **self.conditions}, near)
            return StateSpace(*(np.imag(M) / _COMPLEX_STEP for M in moved))
        for name in names:
            v = values[name]
            if by_complex_step:
                stepped = self.ties.resolve({**values, name: v + _COMPLEX_STEP * 1j})
                stepped_to = as_dense(self._matrices(stepped), complex)
                columns.append([M.imag / _COMPLEX_STEP for M in stepped_to])
            else:
                # the step that balances rounding against the third derivative
                step = np.finfo(float).eps ** (1 / 3) * max(abs(v), 1e-8)
                up, down = (
                    as_dense(self._matrices(self.ties.resolve({**values, name: v + s})), float)
                    for s in (step, -step)
                )
                columns.append([(a - b) / (2 * step) for a, b in zip(up, down, strict=True)])
        return StateSpace(
            *(
                np.array([c[i] for c in columns]).reshape(len(names), *M.shape)
                for i, M in enumerate(at)
            )
        )

    def takes_complex(self, names: Sequence[str]) -> bool:
        """Whether complex steps of these go through and agree with differences; tried once."""
        key = tuple(names)
        if key not in self._carries:
            self._carries[key] = self._tried(self.nominal, names)
        return self._carries[key]

    def _tried(self, values: Mapping[str, float], names: Sequence[str]) -> bool:
        at = self.at(values)
        try:
            # a function that puts its numbers into real arrays loses the step, and says so
            with warnings.catch_warnings(action="error", category=np.exceptions.ComplexWarning):
                exact = self._differentiate(at, values, names, by_complex_step=True)
        except (
            TypeError,
            ValueError,
            AttributeError,
            ArithmeticError,
            np.exceptions.ComplexWarning,
        ):
            return False
        rough = self._differentiate(at, values, names, by_complex_step=False)
        return all(
            bool(
                np.all(np.abs(a - b) <= 1e-4 * np.abs(b).max(axis=(1, 2), keepdims=True, initial=0))
            )
            for a, b in zip(exact, rough, strict=True)
        )
