"""Jobs by processes, or on whatever engine joblib is configured for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import TypeVar

from freqid.checks import InputError

Job = TypeVar("Job")
Answer = TypeVar("Answer")

# how often lost workers are replaced before jobs are done one by one
_LIVES = 2


def unordered(
    work: Callable[[Job], Answer],
    jobs: Sequence[Job],
    n_jobs: int | None,
    lost: Callable[[Job], Answer] | None = None,
) -> Iterator[tuple[int, Answer]]:
    """Number and answer of each job, in the order in which they are finished.

    A worker that is killed takes nothing but its own job with it, which is done again; one that
    ends every worker is answered by ``lost``.
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
    left = set(range(len(jobs)))
    for _ in range(_LIVES):
        parallel = joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered")
        try:
            # each job is made when its turn comes
            asked = (joblib.delayed(_numbered)(work, i, jobs[i]) for i in sorted(left))
            for i, answer in parallel(asked):
                left.discard(i)
                yield i, answer
            return
        except TerminatedWorkerError:
            continue
    for i in sorted(left):
        job = jobs[i]
        answer_alone = alone(work, job)
        if answer_alone is not None:
            yield i, answer_alone
        elif lost is not None:
            yield i, lost(job)
        else:
            raise InputError(
                f"job {i} of {len(jobs)} ends every process that computes it: out of memory, or "
                "by the plant; n_jobs=1 shows where"
            )


def configured() -> bool:
    """Whether joblib has been told where jobs are to run (``joblib.parallel_config``)."""
    try:
        from joblib.parallel import get_active_backend
    except ImportError:
        return False
    backend, given = get_active_backend()
    return type(backend).__name__ != "LokyBackend" or given not in (None, 1)


def every_core() -> int | None:
    """What joblib takes for all cores; None where it is not there."""
    return -1 if find_spec("joblib") else None


def in_turn(
    work: Callable[[Job], Answer],
    jobs: Sequence[Job],
    n_jobs: int | None,
    done: Callable[[int], object],
) -> list[Answer]:
    """The answer of each job, in their order; in this process where ``n_jobs`` is None, unless
    joblib has been told otherwise. ``done`` is called with the number of each that is finished.
    """
    here = n_jobs is None and not configured()
    found: dict[int, Answer] = {}
    for i, answer in unordered(work, jobs, 1 if here else n_jobs):
        found[i] = answer
        done(i)
    return [found[i] for i in range(len(jobs))]


def alone(work: Callable[[Job], Answer], job: Job) -> Answer | None:
    """The answer of one job in a process of its own, None where that is ended."""
    from joblib.externals.loky import ProcessPoolExecutor
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    with ProcessPoolExecutor(max_workers=1) as pool:
        try:
            answer: Answer = pool.submit(work, job).result()
        except TerminatedWorkerError:
            return None
    return answer


def _numbered(work: Callable[[Job], Answer], number: int, job: Job) -> tuple[int, Answer]:
    return number, work(job)
