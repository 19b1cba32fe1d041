"""A process set for many small products and arrays that come and go.

After a threaded product the threads of OpenBLAS wait for the next one by spinning, for a tenth of a
second each: on two cores a fit of tall, thin matrices then runs beside its own idle workers, at
half of its speed.

glibc maps large arrays anew each time, and gives back what is free above twice that size: work that
goes through such arrays touches every page for the first time, again and again, for a third of its
time. In a worker of Dask, which gives back all that it can, it is two thirds.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, wraps
from threading import Lock
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    import threadpoolctl

Args = ParamSpec("Args")
Result = TypeVar("Result")

_held = Lock()


@cache
def _controller() -> threadpoolctl.ThreadpoolController:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# glibc's names for the size from which arrays are mapped on their own, at most 32 MiB, and for what
# may be free before it is given back (mallopt(3))
_MMAP_THRESHOLD, _TRIM_THRESHOLD = -3, -1
_LARGE = 2**25


@cache
def keep_freed_memory() -> None:
    """Let arrays up to 32 MiB come from memory that was freed before; once is enough.

    Twice as much may stay free. Other allocators do not mind.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    # the first alone would fix the second at what the environment says
    mallopt(_MMAP_THRESHOLD, _LARGE)
    mallopt(_TRIM_THRESHOLD, 2 * _LARGE)


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
