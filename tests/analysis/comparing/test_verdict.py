"""On which modes methods agree, and how far they are known: the rules from both sides of every limit, and their words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.analysis.checking.certificate import Certificate
from modalscope.analysis.comparing.beside import Beside
from modalscope.analysis.comparing.diagnosis import Cause
from modalscope.analysis.comparing.scatter import Scatter
from modalscope.analysis.comparing.verdict import AGREE, DIFFER, Tried, Trust, judge, refuted, words
from modalscope.data.modes import ModalModel
from modalscope.selection.judging.grades import GRADES, Grade
from tests.analysis.comparing.made import ALL, ERA, PRCE, group, result
from tests.selection.judging.made import NUDGE

GOOD, LOOK, DOUBTFUL = GRADES
CLOSE, HEAVY = Cause("close pair", "x"), Cause("heavy damping", "y")
LOW = Cause("order too low", "20 % is left")
UNKNOWN = np.full(2, np.nan)
KNOWN = Beside(Grade(GOOD, "known"), UNKNOWN, UNKNOWN)


def agreement(votes: int = 3, voters: int = 3, f: float = 0.0, zeta: float = 0.0, data: tuple[Cause, ...] = ()) -> str:
    """Judge a mode at 10 Hz of 2 % damping: half a bandwidth is 0.2 Hz."""
    return judge(group(10, 0.02, ALL[:votes], voters), (f, zeta), KNOWN, (), data).agreement


@pytest.mark.parametrize(
    ("votes", "voters", "expected"),
    [
        (1, 1, AGREE),
        (1, 2, DIFFER),
        (2, 2, AGREE),
        (2, 3, AGREE),
        (2, 4, DIFFER),
        (3, 4, AGREE),
        (3, 5, DIFFER),
        (4, 6, AGREE),
    ],
)
def test_two_thirds_of_the_methods_found_it(votes: int, voters: int, expected: str) -> None:
    assert agreement(votes, voters) == expected


@pytest.mark.parametrize(("side", "expected"), [(-1, AGREE), (1, DIFFER)])
def test_frequencies_scatter_within_a_half_bandwidth_and_dampings_within_thirty_per_cent(
    side: int, expected: str
) -> None:
    assert agreement(f=0.2 * (1 + side * NUDGE)) == expected
    assert agreement(zeta=0.3 * 0.02 * (1 + side * NUDGE)) == expected


def test_methods_differ_when_the_order_is_too_low_whatever_else_was_found() -> None:
    assert agreement(data=(Cause("bad channel", "x"),)) == AGREE
    assert agreement(data=(Cause("bad channel", "x"), LOW)) == DIFFER


@pytest.mark.parametrize("side", [-1, 1])
def test_methods_differ_from_refined_values_outside_of_their_interval(side: int) -> None:
    half = (0.05, 0.001)
    for values, words_of in (
        ((10 + 0.05 * (1 + side * NUDGE), 0.02), f"but refined it lies at {10 + 0.05 * (1 + side * NUDGE):.6g} Hz"),
        ((10, 0.02 + 0.001 * (1 + side * NUDGE)), "but refined its damping is 2.1 %"),
    ):
        found = judge(group(10, 0.02), (0, 0), KNOWN._replace(values=np.array(values)), (), (), interval=half)
        assert found.agreed is (side < 0)
        assert (words_of in found.why) is (side > 0)
        assert found.trusted is found.agreed


def test_the_grade_is_that_of_the_analysis_and_a_certificate_that_refutes_the_interval_lowers_it() -> None:
    for word in GRADES:
        found = judge(group(10, 0.02), (0, 0), KNOWN._replace(grade=Grade(word, "as it is")), (CLOSE,), ())
        assert (found.grade, found.why) == (word, "as it is; found by 3 of 3 independent methods")
        assert found.trusted is (word == GOOD)
        failed = judge(group(10, 0.02), (0, 0), KNOWN._replace(grade=Grade(word, "as it is")), (), (), refuted=True)
        assert failed.grade == (LOOK if word == GOOD else word)
        assert failed.why.startswith("its interval is refuted by its certificate" if word == GOOD else "as it is")


def test_an_interval_is_refuted_by_the_certificate_of_a_method_that_found_the_mode() -> None:
    g = replace(group(10, 0.02), members={ERA: 1})

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

    assert not refuted(g, None)
    assert not refuted(g, tried(False, True))
    assert refuted(g, tried(True, False))
    assert not refuted(group(10, 0.02, (PRCE,), 1), tried(False, False))


def test_why_names_votes_scatter_and_causes() -> None:
    g = group(10, 0.02, ALL[:2], 4)
    assert judge(g, (0, 0), KNOWN, (CLOSE, HEAVY), ()) == Trust(
        GOOD, "known; found by 2 of 4 independent methods only: close pair, heavy damping", (CLOSE, HEAVY), DIFFER
    )
    g = group(10, 0.02)
    assert judge(g, (0, 0), KNOWN, (), ()).why == "known; found by 3 of 3 independent methods"
    assert judge(g, (0.5, 0), KNOWN, (CLOSE,), ()).why.endswith(", whose frequencies scatter by ±0.5 Hz: close pair")
    assert judge(g, (0.01, 0.01), KNOWN, (), ()).why.endswith(", whose damping scatters by ±50 %")
    assert judge(g, (0, 0), KNOWN, (), (LOW,)).why.endswith(", but order too low")
    assert [Trust(name, "", ()).trusted for name in GRADES] == [True, False, False]
    assert not Trust(GOOD, "", (), DIFFER).trusted


# --------------------------------------------------------------------------------------------------------------- in words

RAN = [result(ERA), result(PRCE)]


def said(grades: list[str | None], data: tuple[Cause, ...] = (), failed: bool = False) -> list[str]:
    """Say what is thought of modes at 1, 2, ... Hz of 2 % damping, of which mode k scatters by k + 1 %; None: good, and methods differ."""
    n = len(grades)
    groups = [group(float(k + 1), 0.02) for k in range(n)]
    scatter = Scatter(np.zeros(n), 0.0002 * np.arange(1, n + 1), *(np.zeros(n),) * 5)
    trust = [Trust(g or GOOD, f"because of {k + 1}", (), AGREE if g else DIFFER) for k, g in enumerate(grades)]
    results = [*RAN, result("alternate (time)", None)] if failed else RAN
    return words(groups, trust, scatter, results, data).split("\n")


def test_methods_agree_on_all_some_one_or_none() -> None:
    assert said([GOOD, LOOK])[0].startswith("Methods agree on all 2 modes: 1, 2 Hz.")
    assert said([GOOD, None])[0].startswith("Methods agree on 1 of 2 modes: 1 Hz.")
    assert said([GOOD])[0].startswith("Methods agree on 1 of 1 modes")
    assert said([None])[0] == "Methods agree on none of the 1 modes."
    assert said([]) == ["No method found a mode."]


def test_the_widest_scatter_is_that_of_the_modes_on_which_methods_agree() -> None:
    assert said([GOOD, GOOD, None])[0].endswith("Widest damping interval of these: ±2 % at 2 Hz.")


def test_every_other_mode_has_its_line_and_findings_their_remedy() -> None:
    lines = said([DOUBTFUL, LOOK, GOOD, None], (LOW,), failed=True)
    assert lines[1:] == [
        "Graded by the analysis of the same data: 2 good, 1 look, 1 doubtful. What methods share (leakage, loading) they cannot see.",
        "Doubtful is 1 Hz: because of 1.",
        "Look at 2 Hz: because of 2.",
        "Methods differ on 4 Hz: because of 4.",
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
