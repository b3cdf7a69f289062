"""A band in parts: cut where resonances are far, each mode and pole once, by the part whose core it lies in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.orders import ORDERS_END
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.bands import SPLIT, Part, cut_of, holds_too_little, joined_diagram, joined_modes
from tests.selection.judging.made import Pole, diagram_of

#: Resonances crowd below 9 and above 20 Hz.
PLACES = (5.0, 6.0, 7.0, 9.0, 20.0, 21.0, 22.0, 24.0)
ORDERS = (10, 20)


def modes_at(*f: float) -> ModalModel:
    n = len(f)
    return ModalModel(
        poles=poles_from(np.array(f), np.full(n, 0.01)), shapes=np.ones((2, n)), participation=np.ones((n, 3))
    )


def lines(low: float = 1.0, high: float = 30.0, count: int = 1000) -> FrequencyResponse:
    return modes_at(*PLACES).frequency_response(np.linspace(low, high, count))


def diagram(response: FrequencyResponse | ImpulseResponse, *f: float, **how: object) -> StabilizationDiagram:
    made = [Pole(n, f=place) for n in ORDERS for place in f]
    return diagram_of(*made, response=response, orders=ORDERS, **how)  # type: ignore[arg-type]


def part(core: tuple[float, float], *f: float, band: tuple[float, float] | None = None, **how: object) -> Part:
    return Part(core, band, diagram(lines(), *f, **how), modes_at(*f))


def test_orders_end_too_soon_when_the_diagram_or_its_modes_say_so() -> None:
    found, modes = diagram(lines(), *PLACES), modes_at(*PLACES)
    assert not holds_too_little(found, modes)
    said = Note(ORDERS_END, {}, "the fit error still falls")
    assert holds_too_little(replace(found, notes=(said,)), modes)
    assert holds_too_little(found, modes.noted(said))


def test_the_cut_lies_in_the_widest_gap_nearer_to_the_narrower_neighbour_and_the_parts_overlap() -> None:
    cut = cut_of(part((1.0, 30.0), *PLACES))
    assert cut is not None
    # half bandwidths of .09 and .2 Hz divide 11 Hz: 9 + 11 * .09 / .29; ten of them are a tenth of the frequency
    assert cut.at == pytest.approx(9 + 11 * 0.09 / 0.29)
    assert (cut.lower, cut.upper) == pytest.approx((cut.at * 1.1, cut.at / 1.1))
    assert cut.halves(part((1.0, 30.0), *PLACES)) == (
        ((1.0, cut.at), (1.0, cut.lower)),
        ((cut.at, 30.0), (cut.upper, 30.0)),
    )


def test_each_half_has_a_quarter_of_the_resonances_at_least() -> None:
    cut = cut_of(part((1.0, 30.0), 2.0, 20.0, 21.0, 22.0, 23.0, 25.0, 26.0, 27.0))
    assert cut is not None
    assert 23 < cut.at < 25


def test_what_has_few_lines_or_resonances_or_is_not_filtered_is_not_cut() -> None:
    assert cut_of(part((1.0, 30.0), 5.0, 20.0, 21.0)) is None
    few = Part((1.0, 30.0), None, diagram(lines(count=300), *PLACES), modes_at(*PLACES))
    assert cut_of(few) is None
    samples = ImpulseResponse(values=np.ones((400, 2, 3)), sampling_rate=60.0)
    assert cut_of(Part((0.0, 30.0), None, diagram(samples, *PLACES), modes_at(*PLACES))) is None


def test_a_part_reports_what_lies_in_its_core_and_a_mode_at_the_cut_is_there_once() -> None:
    # 14 Hz is the cut; half a bandwidth at 14 Hz is .14 Hz
    low, high = part((1.0, 14.0), *PLACES, band=(1.0, 16.0)), part((14.0, 30.0), *PLACES, band=(12.0, 30.0))
    found = joined_modes([low, high], [modes_at(5.0, 14.05, 15.0), modes_at(13.0, 13.95, 20.0)], lines())
    assert len(found) == 3
    assert found.frequencies[[0, 2]] == pytest.approx([5, 20])
    across = joined_modes([low, high], [modes_at(5.0, 13.95), modes_at(14.05, 20.0)], lines())
    assert len(across) == 3
    one_sided = joined_modes([low, high], [modes_at(5.0, 14.05), modes_at(20.0)], lines())
    assert len(one_sided) == 3


def test_what_is_known_of_one_part_only_is_kept() -> None:
    low, high = part((1.0, 14.0), *PLACES, band=(1.0, 16.0)), part((14.0, 30.0), *PLACES, band=(12.0, 30.0))
    known = replace(modes_at(5.0), frequencies_repeatability=np.array([0.1]), unrefined=modes_at(5.01))
    found = joined_modes([low, high], [known, modes_at(20.0)], lines())
    assert found.frequencies_repeatability is not None
    assert found.frequencies_repeatability.tolist() == pytest.approx([0.1, np.nan], nan_ok=True)
    assert found.unrefined is not None
    assert found.unrefined.frequencies == pytest.approx([5.01, 20])


def test_residues_of_the_parts_are_fitted_together_to_the_whole() -> None:
    low, high = part((1.0, 14.0), *PLACES, band=(1.0, 16.0)), part((14.0, 30.0), *PLACES, band=(12.0, 30.0))
    found = joined_modes([low, high], [modes_at(*PLACES[:4]), modes_at(*PLACES[4:])], lines())
    assert np.allclose(found.frequency_response(lines().frequencies).values, lines().values, rtol=1e-6)


def test_the_diagram_has_the_poles_of_each_part_within_its_core() -> None:
    low = part((1.0, 14.0), 5.0, 9.0, 15.0, band=(1.0, 16.0), fit_errors=[0.3, 0.1])
    high = part((14.0, 30.0), 13.0, 20.0, band=(12.0, 30.0), fit_errors=[0.4, 0.2])
    whole = replace(diagram(lines(), 5.0, 20.0), notes=(Note(ORDERS_END, {}, "too soon"),))
    found = joined_diagram(whole, [low, high])
    for order in ORDERS:
        assert found.frequencies[found.order_of_pole == order] == pytest.approx([5, 9, 20])
    assert np.all(np.diff(found.order_of_pole) >= 0)
    # both parts hold the same data here
    assert found.fit_errors == pytest.approx(np.sqrt([(0.09 + 0.16) / 2, (0.01 + 0.04) / 2]))
    assert [note.kind for note in found.notes] == [SPLIT]
    assert "in 2 parts, 1 to 14 Hz, 14 to 30 Hz" in str(found.notes[0])
    assert found.response is whole.response
