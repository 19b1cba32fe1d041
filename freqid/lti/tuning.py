"""A process set for many small products and arrays that come and go.

After a threaded product the threads of OpenBLAS wait for the next one by spinning, for a tenth of a
second each: on two cores a fit of tall, thin matrices then runs beside its own idle workers, at
half of its speed.

glibc maps large arrays anew each time, and gives back what is free above twice that size: work that
goes through such arrays touches every page for the first time, again and again, for a third of its
time. What is large follows the largest array that was freed so far (mallopt(3), dynamic mmap
threshold).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from threading import Lock
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numpy as np

if TYPE_CHECKING:
    import threadpoolctl

Args = ParamSpec("Args")
Result = TypeVar("Result")

_held = Lock()


@cache
def _controller() -> threadpoolctl.ThreadpoolController:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# the most that glibc's threshold rises to, 32 MiB, less what an allocation adds
_LARGE = 2**25 - 2**14


@cache
def keep_freed_memory() -> None:
    """Let arrays below 32 MiB come from memory that was freed before; once is enough.

    The array that is freed here is never touched, and costs nothing. Other allocators do not mind.
    """
    np.empty(_LARGE, np.uint8)


def tuned(function: Callable[Args, Result]) -> Callable[Args, Result]:
    """A function during which BLAS keeps to one thread, beside memory that stays.

    The limit of threads is the process's own, and taken back as the function leaves. Whoever comes
    while it is held runs as it finds things, so that it is always restored to what it was.
    """

    @wraps(function)
    def limited(*args: Args.args, **kwargs: Args.kwargs) -> Result:
        keep_freed_memory()
        if not _held.acquire(blocking=False):
            return function(*args, **kwargs)
        try:
            with _controller().limit(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        finally:
            _held.release()

    return limited
