"""Which modes are trusted: the rules of the grades, from both sides of every limit, and their words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.checking.certificate import Certificate
from modalscope.comparing.diagnosis import Cause
from modalscope.comparing.scatter import Scatter
from modalscope.comparing.verdict import GRADES, Tried, Trust, interval_trouble, judge, words
from modalscope.data.modes import ModalModel
from tests.comparing.made import ALL, ERA, PRCE, group, result
from tests.judging.made import NUDGE

TRUSTED, FREQUENCY, DOUBTFUL = GRADES
CLOSE, HEAVY = Cause("close pair", "x"), Cause("heavy damping", "y")
LOW = Cause("order too low", "20 % is left")


def grade(votes: int = 3, voters: int = 3, f: float = 0.0, zeta: float = 0.0, data: tuple[Cause, ...] = ()) -> str:
    """Grade a mode at 10 Hz of 2 % damping: half a bandwidth is 0.2 Hz."""
    return judge(group(10, 0.02, ALL[:votes], voters), f, zeta, (), data).grade


@pytest.mark.parametrize(
    ("votes", "voters", "expected"),
    [
        (1, 1, TRUSTED),
        (1, 2, DOUBTFUL),
        (2, 2, TRUSTED),
        (2, 3, TRUSTED),
        (2, 4, DOUBTFUL),
        (3, 4, TRUSTED),
        (3, 5, DOUBTFUL),
        (4, 6, TRUSTED),
    ],
)
def test_two_thirds_of_the_methods_found_it(votes: int, voters: int, expected: str) -> None:
    assert grade(votes, voters) == expected


@pytest.mark.parametrize(("side", "expected"), [(-1, TRUSTED), (1, DOUBTFUL)])
def test_its_frequency_scatters_within_a_half_bandwidth(side: int, expected: str) -> None:
    assert grade(f=0.2 * (1 + side * NUDGE)) == expected


@pytest.mark.parametrize(("side", "expected"), [(-1, TRUSTED), (1, FREQUENCY)])
def test_its_damping_scatters_within_thirty_per_cent(side: int, expected: str) -> None:
    assert grade(zeta=0.3 * 0.02 * (1 + side * NUDGE)) == expected


def test_an_open_frequency_is_worse_than_open_damping() -> None:
    assert grade(f=0.3, zeta=0.01) == DOUBTFUL


def test_no_mode_is_trusted_when_the_order_is_too_low_whatever_else_was_found() -> None:
    assert grade(data=(Cause("bad channel", "x"),)) == TRUSTED
    assert grade(data=(Cause("bad channel", "x"), LOW)) == DOUBTFUL


def test_without_an_interval_that_holds_only_the_frequency_is_trusted() -> None:
    found = judge(group(10, 0.02), 0, 0, (), (), "standard deviation of its damping unknown")
    assert (found.grade, found.why) == (
        FREQUENCY,
        "found by 3 of 3 independent witnesses; standard deviation of its damping unknown",
    )


def test_an_interval_is_in_trouble_when_it_is_not_known_or_its_certificate_refutes_it() -> None:
    g = replace(group(10, 0.02), members={ERA: 1})
    assert interval_trouble(g, 0.1, 0.1, None) == ""
    assert interval_trouble(g, np.nan, np.nan, None) == "standard deviation of its frequency and damping unknown"
    assert interval_trouble(g, 0.1, np.nan, None) == "standard deviation of its damping unknown"

    def tried(*holds: bool) -> Tried:
        nothing = {k: np.zeros(2) for k in ("bias", "ratio", "coverage")}
        model = ModalModel(poles=[-1 + 10j, -1 + 20j], shapes=[[1, 1]])
        counts = np.full(2, 40)
        made = Certificate(
            modes=model,
            frequency=nothing,
            damping_ratio=nothing,
            holds=np.array(holds),
            found=counts,
            replicates=counts,
            order=4,
        )
        return Tried(ERA, made)

    assert interval_trouble(g, 0.1, 0.1, tried(False, True)) == ""
    assert interval_trouble(g, 0.1, 0.1, tried(True, False)) == "its interval is refuted by its certificate"
    assert interval_trouble(group(10, 0.02, (PRCE,), 1), 0.1, 0.1, tried(False, False)) == ""


def test_why_names_votes_scatter_and_causes() -> None:
    g = group(10, 0.02, ALL[:2], 4)
    assert judge(g, 0, 0, (CLOSE, HEAVY), ()) == Trust(
        DOUBTFUL, "only found by 2 of 4 independent witnesses: close pair, heavy damping", (CLOSE, HEAVY)
    )
    g = group(10, 0.02)
    assert judge(g, 0, 0, (), ()).why == "found by 3 of 3 independent witnesses"
    assert judge(g, 0.5, 0, (CLOSE,), ()).why.endswith("; frequency uncertain by ±0.5 Hz: close pair")
    assert judge(g, 0.01, 0.01, (), ()).why.endswith("; damping uncertain by ±50 %")
    assert judge(g, 0, 0, (), (LOW,)).why.endswith("but order too low")
    assert [Trust(name, "", ()).trusted for name in GRADES] == [True, False, False]


# --------------------------------------------------------------------------------------------------------------- in words

RAN = [result(ERA), result(PRCE)]


def said(grades: list[str], data: tuple[Cause, ...] = (), failed: bool = False) -> list[str]:
    """Say what is thought of modes at 1, 2, ... Hz of 2 % damping, of which mode k scatters by k + 1 %."""
    n = len(grades)
    groups = [group(float(k + 1), 0.02) for k in range(n)]
    scatter = Scatter(np.zeros(n), 0.0002 * np.arange(1, n + 1), *(np.zeros(n),) * 5)
    trust = [Trust(g, f"because of {k + 1}", ()) for k, g in enumerate(grades)]
    results = [*RAN, result("alternate (time)", None)] if failed else RAN
    return words(groups, trust, scatter, results, data).split("\n")


def test_all_some_one_or_none_can_be_trusted() -> None:
    assert said([TRUSTED, TRUSTED])[0].startswith("All 2 modes can be trusted in frequency and damping: 1, 2 Hz.")
    assert said([TRUSTED, DOUBTFUL])[0].startswith("1 of 2 modes can be trusted in frequency and damping: 1 Hz.")
    assert said([TRUSTED])[0].startswith("1 of 1 modes can be trusted")
    assert said([DOUBTFUL])[0] == "None of the 1 modes can be trusted in full."
    assert said([]) == ["No method found a mode."]


def test_the_widest_scatter_is_that_of_the_trusted() -> None:
    assert said([TRUSTED, TRUSTED, DOUBTFUL])[0].endswith("Widest damping interval: ±2 % at 2 Hz.")


def test_every_other_mode_has_its_line_and_findings_their_remedy() -> None:
    lines = said([DOUBTFUL, FREQUENCY, TRUSTED], (LOW,), failed=True)
    assert lines[1:] == [
        "Trust the frequency, but not the damping, of 2 Hz: because of 2.",
        "Do not trust 1 Hz: because of 1.",
        "Order too low: 20 % is left. Raise the largest order.",
        "1 of 3 methods failed: SSI-cov (alternate).",
    ]


def test_where_every_method_failed_the_reason_of_the_first_is_all_there_is_to_say() -> None:
    nothing = Scatter(*(np.zeros(0),) * 7)
    assert words([], [], nothing, [result(ERA, None)], ()) == "No method could use these data. it could not"


@pytest.mark.parametrize(
    ("evidence", "said"),
    [("a channel is dead", "Too short: a channel is dead. "), ("too short, by 3 dB.", "Too short, by 3 dB. ")],
)
def test_a_cause_is_named_once_and_ends_in_one_stop(evidence: str, said: str) -> None:
    cause = Cause("too short", evidence)
    nothing = Scatter(*np.zeros((7, 0)))
    line = words([], [], nothing, [result(ERA)], [cause]).splitlines()[-1]
    assert line == said + cause.remedy
