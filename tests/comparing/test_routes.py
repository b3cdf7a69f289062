"""Ways from records as witnesses: one whose modes explain too little has no vote against the way that the records ask for."""

from dataclasses import replace

import pytest

from modalscope.comparing.routes import route_causes
from modalscope.comparing.run import MethodResult
from modalscope.identification.lookup import find_method


def result(route: str, fit_error: float | None) -> MethodResult:
    return MethodResult(method=find_method("alternate", "s", "s"), exact=True, route=route, fit_error=fit_error)


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
    ],
)
def test_a_way_that_explains_little_has_no_vote_beside_one_that_explains_enough(errors, voting):
    results = [result(route, error) for route, error in zip(("records", "frf", "n4sid"), errors, strict=True)]
    judged, causes = route_causes(results)
    assert tuple(r.exact for r in judged) == voting
    assert [c.name for c in causes] == ["poor fit"] * voting.count(False)
    assert all("route n4sid" in c.evidence and "19 %" in c.evidence for c in causes)
    assert all(c.remedy for c in causes)


def test_data_that_are_no_records_keep_all_votes():
    results = [replace(result("", error), exact=True) for error in (0.1, 0.95)]
    assert route_causes(results) == (tuple(results), [])
