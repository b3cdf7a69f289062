"""The limit on threads holds while verbs run, also side by side, and leaves no trace."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
import scipy.linalg  # noqa: F401  (loaded, so that its threads are counted)
from threadpoolctl import threadpool_info, threadpool_limits

from modalscope.blocks.threads import one_thread


def blas_threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


@pytest.fixture
def two_threads():
    with threadpool_limits(2, user_api="blas"):
        yield blas_threads()


def test_one_thread_while_a_verb_runs_and_as_before_after_it(two_threads):
    assert set(one_thread(blas_threads)()) == {1}
    assert blas_threads() == two_threads


def test_verbs_side_by_side_leave_the_threads_as_they_were(two_threads):
    with ThreadPoolExecutor(4) as pool:
        seen = list(pool.map(lambda _: one_thread(blas_threads)(), range(40)))
    assert all(set(counts) == {1} for counts in seen)
    assert blas_threads() == two_threads


def test_an_error_takes_the_limit_back_too(two_threads):
    @one_thread
    def fails() -> None:
        raise ValueError("on purpose")

    with pytest.raises(ValueError, match="on purpose"):
        fails()
    assert blas_threads() == two_threads
