"""Whatever is given where something else belongs is answered by a DataError, never by numpy's or Python's own words."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain, chain5

LINES = np.linspace(0.2, 9, 120)
RESPONSE = chain5().frequency_response(LINES, quantity="acceleration", noise=0.01, seed=0)
MODEL = chain5().state_space(dt=0.05)
PULSE = MODEL.impulse_response(60)
DIAGRAM = ms.stabilize(RESPONSE, orders=range(2, 15, 2))
MODES = ms.select(DIAGRAM)

#: Of wrong types, sizes and values; none of them means anything in any of the places below.
WRONG = {
    "text": "x",
    "bytes": b"x",
    "object": object(),
    "not a number": float("nan"),
    "complex": 1j,
    "negative": -5,
    "huge": 10**30,
    "function": repr,
    "ragged": [[1, 2], [3]],
    "texts": np.array(["a"]),
    "cube of NaN": np.full((2, 2, 2), np.nan),
    "mapping": {"a": 1},
    "diagram": DIAGRAM,
}

identify = partial(ms.identify, PULSE, method="era", order=4)
stabilize = partial(ms.stabilize, RESPONSE, method="alternate", orders=(2, 4))
fields = {name: getattr(RESPONSE, name) for name in ("values", "frequencies")}

PLACES = {
    "frf output_dofs": lambda x: ms.FrequencyResponse(**fields, output_dofs=x),
    "frf units": lambda x: ms.FrequencyResponse(**fields, units=(x, None)),
    "frf quantity": lambda x: ms.FrequencyResponse(**fields, quantity=x),
    "frf geometry": lambda x: ms.FrequencyResponse(**fields, geometry=x),
    "frf band": lambda x: RESPONSE.band(x, 5.0),
    "frf select": lambda x: RESPONSE.select(outputs=x),
    "modes indicators": lambda x: ms.ModalModel(poles=[-1 + 9j], shapes=[[1.0]], indicators=x),
    "modes reasons": lambda x: ms.ModalModel(poles=[-1 + 9j], shapes=[[1.0]], reasons=x),
    "modes dt": lambda x: ms.ModalModel(poles=[-1 + 9j], shapes=[[1.0]], dt=x),
    "lines of a model": lambda x: MODEL.frequency_response(x),
    "samples": MODEL.impulse_response,
    "data": lambda x: ms.identify(x, order=4),
    "method": lambda x: ms.identify(PULSE, method=x, order=4),
    "domain": lambda x: identify(domain=x),
    "order": lambda x: ms.identify(PULSE, order=x),
    "band": lambda x: identify(band=x),
    "band of lines": lambda x: stabilize(band=x),
    "exclude": lambda x: identify(exclude=x),
    "form": lambda x: identify(form=x),
    "block_rows": lambda x: identify(block_rows=x),
    "row_shifts": lambda x: identify(row_shifts=x),
    "row_subsets": lambda x: identify(row_subsets=x, block_rows=3),
    "row_shifts of lines": lambda x: ms.identify(RESPONSE, method="era", order=4, row_shifts=x),
    "weights": lambda x: stabilize(weights=x),
    "weights of samples": lambda x: identify(domain="z", weights=x),
    "orders": lambda x: ms.stabilize(RESPONSE, orders=x),
    "tolerances": lambda x: stabilize(tolerances=x),
    "diagram": lambda x: ms.select(x),
    "frequencies by hand": lambda x: ms.select(DIAGRAM, frequencies=x),
    "shapes": lambda x: ms.mac(x, MODES.shapes),
    "cmif": ms.indicators.cmif,
    "mmif": ms.indicators.mmif,
    "dwell": ms.tuned_dwell,
    "places": lambda x: ms.place(MODES, sensors=x),
    "places to keep": lambda x: ms.place(MODES, sensors=1, keep=x),
    "results to merge": lambda x: ms.merge_bands(x, [(0, 5)]),
    "bands to merge": lambda x: ms.merge_bands([MODES], x),
    "masses measured": lambda x: chain([1, 1], [9, 9], outputs=x),
    "noise": lambda x: chain5().frequency_response(LINES, noise=x),
    "seed": lambda x: chain5().frequency_response(LINES, noise=0.1, seed=x),
    "plot of a diagram": lambda x: ms.plot.stabilization(x),
    "plot of responses": lambda x: ms.plot.response(RESPONSE, x),
    "plot of a shape": lambda x: ms.plot.shape(x, 0),
    "plot of a MAC": ms.plot.mac,
    "file": lambda x: ms.read(x),
}


#: What does mean something in its place.
MEANT = {
    ("frf units", "text"),
    ("frf band", "negative"),
    ("modes dt", "huge"),
    ("lines of a model", "huge"),
    ("diagram", "diagram"),
    ("masses measured", "mapping"),
    ("noise", "huge"),
    ("plot of a diagram", "diagram"),
}


@pytest.mark.parametrize("place", PLACES)
def test_what_does_not_belong_is_a_data_error(place: str) -> None:
    for name, wrong in WRONG.items():
        if (place, name) in MEANT:
            continue
        with pytest.raises(ms.DataError) as told:
            PLACES[place](wrong)
        assert all((told.value.asked, told.value.found, told.value.change)), name


def test_orders_and_shifts_are_not_rounded() -> None:
    """2.5 states are a mistake; they were two, silently."""
    with pytest.raises(ms.DataError, match=r"order needs a whole number.*2\.5"):
        ms.stabilize(RESPONSE, orders=[2.5, 4])
    with pytest.raises(ms.DataError, match=r"row_shifts needs a whole number.*1\.5"):
        ms.identify(PULSE, order=4, row_shifts=[0, 1.5])


def test_what_cannot_be_used_is_refused_or_said() -> None:
    """Weights of the lines of samples are refused; a band of samples, which filters nothing, is in the notes."""
    with pytest.raises(ms.DataError, match="'weights'"):
        ms.identify(PULSE, method="era", domain="z", order=4, weights="level")
    found = ms.identify(PULSE, order=10, band=(2, 5))
    assert any("Samples are not filtered" in str(note) for note in found.notes)


def test_frequencies_by_hand_are_a_list_of_them() -> None:
    with pytest.raises(ms.DataError, match="frequencies needs numbers in Hz, but it is float"):
        ms.select(DIAGRAM, frequencies=0.9)  # type: ignore[arg-type]
    with pytest.raises(ms.DataError, match="the list is empty"):
        ms.select(DIAGRAM, frequencies=[])


def test_only_nouns_are_written(tmp_path: Path) -> None:
    for name in ("a.npz", "a.json", "a.uff", "a.csv"):
        with pytest.raises(ms.DataError, match=r"what is written: expected FrequencyResponse, .* got dict"):
            ms.write(tmp_path / name, {"values": 1})
    assert not list(tmp_path.iterdir())
