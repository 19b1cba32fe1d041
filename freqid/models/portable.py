"""Functions that a pickle can carry, whether or not a module holds them."""

from __future__ import annotations

import pickle
from collections.abc import Callable

from freqid.checks import State


class Portable:
    """A function on its way through a pickle: by its name, or by its code where it has none.

    The code of a lambda, or of a function inside another one, is written by cloudpickle and is run
    where it is read: like any pickle, it is for those who trust each other.
    """

    def __init__(self, function: Callable[..., object]) -> None:
        self.function = function

    def __deepcopy__(self, memo: object) -> Portable:
        # a copy in the same process calls the same function
        return self

    def __reduce__(self) -> tuple[object, tuple[object]]:
        try:
            # by its name, which another process looks for in a script that it does not run
            known = b"__main__" not in pickle.dumps(self.function)
        except (pickle.PicklingError, AttributeError, TypeError):
            known = False
        if known:
            return Portable, (self.function,)
        import cloudpickle

        return _from_code, (cloudpickle.dumps(self.function),)


def _from_code(code: bytes) -> Portable:
    return Portable(pickle.loads(code))


def carried(state: State, *names: str) -> State:
    """What a pickle takes of an object's fields, of which those ``names`` are functions."""
    return state | {n: Portable(state[n]) for n in names if callable(state.get(n))}


def arrived(state: State) -> State:
    """The fields from what a pickle took of them."""
    return {k: v.function if isinstance(v, Portable) else v for k, v in state.items()}
