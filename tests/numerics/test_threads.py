"""The limit on threads holds while verbs run, and leaves no trace."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.linalg  # noqa: F401  (loaded, so that its threads are counted)
from threadpoolctl import threadpool_info, threadpool_limits

from modalscope.numerics.resources import one_thread, single_threaded


def blas_threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


@pytest.fixture
def two_threads():
    with threadpool_limits(2, user_api="blas"):
        yield blas_threads()


def test_one_thread_while_a_verb_runs_and_as_before_after_it(two_threads):
    assert set(one_thread(blas_threads)()) == {1}
    assert blas_threads() == two_threads


def test_a_verb_that_runs_inside_another_does_not_take_its_limit_back(two_threads):
    @one_thread
    def outer() -> tuple[list[int], list[int]]:
        return one_thread(blas_threads)(), blas_threads()

    inside, after = outer()
    assert set(inside) == set(after) == {1}
    assert blas_threads() == two_threads


def test_an_error_takes_the_limit_back_too(two_threads):
    @one_thread
    def fails() -> None:
        raise ValueError("on purpose")

    with pytest.raises(ValueError, match="on purpose"):
        fails()
    assert blas_threads() == two_threads


def test_two_calls_that_overlap_give_the_threads_back_when_the_last_has_ended(two_threads):
    """The first to begin is the first to end: with a limit each, the second would have given the first one's back for good."""
    first, second = single_threaded(), single_threaded()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert set(blas_threads()) == {1}
    second.__exit__(None, None, None)
    assert blas_threads() == two_threads


def test_many_threads_that_call_at_once_leave_no_trace(two_threads):
    @one_thread
    def work(seconds: float) -> list[int]:
        time.sleep(seconds)
        return blas_threads()

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(work, np.random.default_rng(0).uniform(0, 0.01, 60)))
    assert all(set(threads) == {1} for threads in found)
    assert blas_threads() == two_threads
