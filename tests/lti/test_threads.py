"""Fits hold BLAS at one thread and give the others back, however they end and whoever else fits."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import freqid as fq


def threads():
    return {lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}


def seen_inside(**options):
    """BLAS threads while a fit computes its model."""
    seen = []

    def matrices(a):
        seen.append(threads())
        return np.array([[-a]]), np.array([[a]]), np.array([[1.0]]), None

    record = fq.simulate(fq.first_order(b=1, a=1), fq.chirp(0.1, 2, 20, 0.02), 0.02)
    model = fq.GreyBox(matrices, [fq.Parameter("a", 2.0)])
    seen.clear()
    fq.fit(model, record, **options)
    return set().union(*seen)


def test_a_fit_runs_on_one_thread_of_blas_and_gives_the_others_back():
    with threadpool_limits(2, "blas"):
        assert seen_inside() == {1}
        assert threads() == {2}


def test_a_fit_that_fails_gives_them_back_too():
    with threadpool_limits(2, "blas"):
        with pytest.raises(ValueError, match="n_starts"):
            seen_inside(n_starts=0)
        assert threads() == {2}


def test_fits_in_several_threads_leave_the_process_as_it_was():
    before = threads()
    with ThreadPoolExecutor(4) as pool:
        assert len([pool.submit(seen_inside).result() for _ in range(12)]) == 12
        list(pool.map(lambda _: seen_inside(), range(12)))
    assert threads() == before
