"""One thread for BLAS while many small products are made.

After a threaded product the threads of OpenBLAS wait for the next one by spinning, for a tenth of a
second each: on two cores a fit of tall, thin matrices then runs beside its own idle workers, at
half of its speed.
"""

from __future__ import annotations

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


def in_one_blas_thread(function: Callable[Args, Result]) -> Callable[Args, Result]:
    """A function during which BLAS keeps to one thread; the limit is taken back as it leaves.

    The limit is the process's own. Whoever comes while it is held runs as it finds things, so that
    it is always restored to what it was.
    """

    @wraps(function)
    def limited(*args: Args.args, **kwargs: Args.kwargs) -> Result:
        if not _held.acquire(blocking=False):
            return function(*args, **kwargs)
        try:
            with _controller().limit(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        finally:
            _held.release()

    return limited
