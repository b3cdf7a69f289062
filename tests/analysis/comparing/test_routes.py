"""Ways from records as witnesses: one that sees little has no vote against the way that the records ask for."""

from types import SimpleNamespace
from typing import Any

import pytest

from modalscope.analysis.comparing.routes import route_causes
from modalscope.analysis.comparing.run import MethodResult
from modalscope.identification.method_names import find_method
from tests.support import FIVE

MODES = FIVE["chain5"]().modes()


def result(route: str, fit_error: float | None, most: int = 20) -> MethodResult:
    """What a way gave: five modes of orders up to `most`, which leave so much; nothing where it failed."""
    diagram: Any = SimpleNamespace(
        orders=tuple(range(1, most + 1)), notes=(), response=SimpleNamespace(grid=None, processing=())
    )
    found = {} if fit_error is None else {"modes": MODES, "diagram": diagram, "fit_error": fit_error}
    return MethodResult(method=find_method("alternate", "s", "s"), exact=True, route=route, **found)


@pytest.mark.parametrize(
    ("errors", "voting"),
    [
        ((0.1, 0.2, 0.9), (True, True, False)),  # the third sees little, and the first enough
        ((0.1, None, 0.9), (True, True, False)),  # a way that failed has no modes to vote with
        ((0.5, 0.1, 0.9), (True, True, False)),
        (
            (0.9, 0.1, 0.8),
            (True, True, True),
        ),  # noise in the records: what they ask for keeps its vote, and the others theirs
        ((None, 0.1, 0.9), (True, True, True)),
    ],
)
def test_a_way_that_explains_little_has_no_vote_beside_one_that_explains_enough(errors, voting):
    ways = ("records", "frf", "subspace")
    judged, causes = route_causes([result(way, error) for way, error in zip(ways, errors, strict=True)])
    assert tuple(r.exact for r in judged) == voting
    assert [c.name for c in causes] == ["poor fit"] * voting.count(False)
    assert all("route subspace" in c.evidence and "90 % unexplained" in c.evidence for c in causes)
    assert all(c.remedy for c in causes)


@pytest.mark.parametrize(("most", "votes"), [(3, False), (9, False), (10, True)])
def test_a_way_whose_orders_cannot_hold_the_modes_has_no_vote(most, votes):
    judged, causes = route_causes([result("records", 0.1), result("markov", 0.02, most)])
    assert [r.exact for r in judged] == [True, votes]
    assert [c.name for c in causes] == ([] if votes else ["too few blocks"])
    assert all(f"orders up to {most}, 5 modes need 10" in c.evidence for c in causes)


def test_data_that_are_no_records_keep_all_votes():
    results = [result("", error) for error in (0.1, 0.95)]
    assert route_causes(results) == (tuple(results), [])
