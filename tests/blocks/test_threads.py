"""The limit on threads holds while verbs run, and leaves no trace."""

from __future__ import annotations

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
