"""Every argument of every public callable is given what means nothing there, and answers with a DataError, or in words that name it."""

from __future__ import annotations

import signal
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.arguments import WRONG, calls, judge, right
from tests.test_docstrings import CALLABLES

#: Callables whose right answer takes a second or more: wrong values that mean something there are left to the study.
SLOW = ("report", "compare", "analyze", "replay", "fit_residues", "certify")


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Close pictures; numpy may warn of what it is given."""
    from matplotlib import pyplot

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
    pyplot.close("all")


@pytest.mark.slow
def test_every_public_callable_with_arguments_is_tried() -> None:
    tried = {name.partition(" of ")[0] for name, *_ in calls()}
    assert len(tried) > 0.55 * len(CALLABLES)  # the others take no argument, or are made by others


@pytest.mark.slow
def test_right_calls_are_answered() -> None:
    """Else every wrong value would be refused for a reason that has nothing to do with it."""
    for name, (call, given) in {name: (call, given) for name, call, given, _ in calls()}.items():
        if name not in SLOW:
            call(**given)


@pytest.mark.slow
@pytest.mark.parametrize("shift", range(2))
def test_two_wrong_values_for_every_argument(shift: int) -> None:
    """Others for each, so that all kinds are tried; `make study` tries all of them for all."""
    names, told = list(WRONG), {}
    for k, (name, call, given, argument) in enumerate(calls()):
        if name in SLOW:
            continue
        wrong = names[(k + 17 * shift) % len(names)]
        answer = judge(call, given, argument, WRONG[wrong]())
        if answer:
            told[f"{name}({argument}={wrong})"] = answer
    assert not told


@contextmanager
def within(seconds: int) -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"no answer within {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.study("robustness")
def test_all_wrong_values_for_every_argument(study) -> None:
    """Each answered within 20 s."""
    import resource

    limits = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(
        resource.RLIMIT_AS, (3 << 30, limits[1])
    )  # memory without end is an error, not the end of the machine
    right()
    begun, count, told = time.monotonic(), 0, {}
    try:
        for name, call, given, argument in calls():
            for wrong, make in WRONG.items():
                count += 1
                with within(20):
                    answer = judge(call, given, argument, make())
                if answer:
                    told[f"{name}({argument}={wrong})"] = answer
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
    table = study("all wrong values for every argument of the public names", f"{count} calls")
    table.row("answered in other words than a DataError", len(told), most=0)
    table.row("time", time.monotonic() - begun, form=".0f", unit=" s")
    assert not told
