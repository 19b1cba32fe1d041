"""Jobs by processes, or on whatever engine joblib is configured for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from freqid.checks import InputError

Job = TypeVar("Job")
Answer = TypeVar("Answer")

# how often lost workers are replaced
_LIVES = 5


def unordered(
    work: Callable[[Job], Answer], jobs: Sequence[Job], n_jobs: int | None
) -> Iterator[tuple[int, Answer]]:
    """Number and answer of each job, in the order in which they are finished.

    A worker that is killed takes nothing but its own job with it, which is done again.
    """
    if n_jobs == 1:
        yield from ((i, work(job)) for i, job in enumerate(jobs))
        return
    try:
        import joblib
        from joblib.externals.loky.process_executor import TerminatedWorkerError
    except ImportError:
        if n_jobs is not None:
            raise InputError(
                f"n_jobs={n_jobs} needs joblib; pip install 'freqid[parallel]'"
            ) from None
        yield from ((i, work(job)) for i, job in enumerate(jobs))
        return
    left = dict(enumerate(jobs))
    for life in range(_LIVES):
        parallel = joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered")
        try:
            asked = [joblib.delayed(_numbered)(work, i, job) for i, job in left.items()]
            for i, answer in parallel(asked):
                del left[i]
                yield i, answer
            return
        except TerminatedWorkerError:
            if life == _LIVES - 1:
                raise


def _numbered(work: Callable[[Job], Answer], number: int, job: Job) -> tuple[int, Answer]:
    return number, work(job)
