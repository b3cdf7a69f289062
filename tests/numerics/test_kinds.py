"""What a person reads who gives the wrong type, or misspells an option: what was expected, what it is, and the way out."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import DataError, Records
from modalscope.numerics.checks import check_kind
from modalscope.numerics.errors import check_option_names
from modalscope.systems import chain5
from tests.support import refused

pd = pytest.importorskip("pandas")

STRUCTURE = chain5()
FRF = STRUCTURE.frequency_response(np.linspace(0.2, 9, 60))
PULSE = STRUCTURE.impulse_response(60)
RECORD = STRUCTURE.simulate(samples=50, seed=0)
MODES = STRUCTURE.modes()
DIAGRAM = ms.stabilize(FRF, orders=(2, 4))
FOUND = ms.identify(PULSE, order=4)

DATA = (ms.FrequencyResponse, ms.ImpulseResponse, ms.Signals)


@pytest.mark.parametrize(
    ("given", "expected", "message"),
    [
        (
            np.ones(3) * 1j,
            ms.FrequencyResponse,
            "expected FrequencyResponse, got ndarray: wrap it as FrequencyResponse(values=..., frequencies=...)",
        ),
        (np.ones(3) * 1j, DATA, "got ndarray: wrap it as FrequencyResponse(values=..., frequencies=...)"),
        (
            np.ones(3),
            DATA,
            "expected FrequencyResponse, ImpulseResponse or Signals, got ndarray: wrap it as "
            "ImpulseResponse(values=..., sampling_rate=...) or Signals(outputs=..., sampling_rate=...)",
        ),
        ([1.0, 2.0], ms.Signals, "got list: wrap it as Signals(outputs=..., sampling_rate=...)"),
        ("test.uff", ms.FrequencyResponse, "expected FrequencyResponse, got text: read it first: ms.read(path)"),
        (Path("test.uff"), DATA, "read it first: ms.read(path)"),
        ((MODES, DIAGRAM), ms.ModalModel, "expected ModalModel, got tuple: give only its item 0, counted from 0"),
        ((MODES, DIAGRAM), ms.StabilizationDiagram, "give only its item 1, counted from 0"),
        ([RECORD, RECORD], ms.Signals, "got list: put them together first, ms.merge([...]), or give them one by one"),
        (
            pd.DataFrame({"a": [1.0]}),
            ms.Signals,
            "got DataFrame: take its numbers, table.to_numpy(), and wrap it as Signals(outputs=..., sampling_rate=...)",
        ),
        (RECORD, ms.FrequencyResponse, "got Signals: estimate it first: ms.estimate_frf(record)"),
        (PULSE, ms.FrequencyResponse, "transform it: response.to_frequency_response()"),
        (FRF, ms.ImpulseResponse, "transform it: response.to_impulse_response()"),
        (FRF, ms.StabilizationDiagram, "make it first: ms.stabilize(data)"),
        (DIAGRAM, ms.ModalModel, "select them first: ms.select(diagram)"),
        (FOUND, ms.ModalModel, "give its modes: result.modes"),
        (MODES[0], ms.ModalModel, "give all of them: mode.modes"),
        (Records(runs=(RECORD,)), ms.Signals, "give one of its runs: records.runs[0]"),
        (STRUCTURE, ms.FrequencyResponse, "compute it: structure.frequency_response(frequencies)"),
        (None, ms.ModalModel, "expected ModalModel, got None: give ModalModel"),
        (3, str, "expected text, got int: give text"),
        (1, bool, "expected True or False, got int"),
    ],
)
def test_the_message_says_how_to_make_what_is_expected(given: Any, expected: Any, message: str) -> None:
    with pytest.raises(DataError) as told:
        check_kind("the verb", given, expected)
    text = str(told.value)
    assert text.startswith("the verb: expected ")
    assert message in text
    assert "\n" not in text
    assert all((told.value.asked, told.value.found, told.value.change))
    again = pickle.loads(pickle.dumps(told.value))
    assert str(again) == text


#: Verb -> its first argument, and what it takes there.
VERBS: dict[str, tuple[Callable[[Any], Any], tuple[str, ...]]] = {
    "estimate_frf": (ms.estimate_frf, ("record",)),
    "estimate_correlation": (ms.estimate_correlation, ("record",)),
    "estimate_markov": (ms.estimate_markov, ("record",)),
    "filter_band": (lambda x: ms.preprocess.filter_band(x, 1, 3), ("record",)),
    "half_spectra": (ms.preprocess.half_spectra, ("pulse",)),
    "decomposition": (ms.preprocess.decomposition, ("record",)),
    "examine": (ms.preprocess.examine, ("frf", "pulse", "record", "records")),
    "merge": (lambda x: ms.merge([x]), ("frf", "pulse", "record", "records")),
    "identify": (lambda x: ms.identify(x, order=4), ("frf", "pulse", "record", "records")),
    "realize": (lambda x: ms.realize(x, order=4), ("frf", "pulse", "record", "records")),
    "stabilize": (lambda x: ms.stabilize(x, orders=(2, 4)), ("frf", "pulse", "record", "records")),
    "compare": (lambda x: ms.compare(x, methods=["era"], orders=(2, 4)), ("frf", "pulse", "record", "records")),
    "select": (ms.select, ("diagram",)),
    "merge_bands": (lambda x: ms.merge_bands([x], [(0, 9)]), ("modes",)),
    "fit_residues": (lambda x: ms.fit_residues(x, MODES), ("frf",)),
    "modes of fit_residues": (lambda x: ms.fit_residues(FRF, x), ("modes",)),
    "mmif": (ms.indicators.mmif, ("frf",)),
    "tuned_dwell": (ms.tuned_dwell, ("frf", "record", "records")),
    "place": (lambda x: ms.place(x, sensors=1), ("modes",)),
    "equations_of_motion": (ms.equations_of_motion, ("model",)),
    "first_order_form": (ms.first_order_form, ("model",)),
    "plot.stabilization": (ms.plot.stabilization, ("diagram",)),
    "plot.response": (ms.plot.response, ("frf", "pulse")),
    "plot.shape": (lambda x: ms.plot.shape(x, 0), ("modes",)),
    "plot.complexity": (lambda x: ms.plot.complexity(x, 0), ("modes",)),
    "plot.indicator": (ms.plot.indicator, ("frf", "pulse")),
    "plot.fit_errors": (ms.plot.fit_errors, ("diagram",)),
    "plot.method_map": (ms.plot.method_map, ()),
    "plot.deviations": (ms.plot.deviations, ()),
}

THINGS = {
    "array": np.ones((5, 2, 2)),
    "list": [1.0, 2.0],
    "path": "test.uff",
    "nothing": None,
    "frf": FRF,
    "pulse": PULSE,
    "record": RECORD,
    "records": Records(runs=(RECORD,)),
    "modes": MODES,
    "diagram": DIAGRAM,
    "pair": (MODES, DIAGRAM),
    "structure": STRUCTURE,
    "model": STRUCTURE.state_space(),
}


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_says_what_it_expects(verb: str) -> None:
    call, takes = VERBS[verb]
    for name, thing in THINGS.items():
        if name not in takes:
            with pytest.raises(DataError, match=r": expected .*, got \w+"):
                call(thing)


def test_a_misspelt_option_names_the_nearest() -> None:
    known = ["order", "block_rows", "block_columns"]
    check_option_names("identify", ["order"], known)
    with pytest.raises(DataError) as told:
        check_option_names("identify", ["blok_rows"], known)
    assert str(told.value) == "identify() has no option 'blok_rows'; did you mean 'block_rows'?"
    assert told.value.change == "Did you mean 'block_rows'?"


@pytest.mark.parametrize(
    ("verb", "name", "message"),
    [
        ("identify", "zzz", "identify() has no option 'zzz'; its options are order, block_rows"),
        (
            "identify(method='era')",
            "weights",
            "identify(method='era') has no option 'weights'; it belongs to lscf, prce",
        ),
        ("identify", "wieghts", "identify() has no option 'wieghts'; did you mean 'weights'?"),
    ],
)
def test_an_option_of_others_names_them(verb: str, name: str, message: str) -> None:
    with pytest.raises(DataError) as told:
        check_option_names(verb, [name], ["order", "block_rows"], {"weights": ["lscf", "prce"]})
    assert str(told.value) == message
    with pytest.raises(DataError, match="it has no options"):
        check_option_names("methods", ["order"], [])


def test_an_option_of_reading_is_sent_there() -> None:
    """`columns` is no misspelt `block_columns`: it says how a file is read."""
    for name in ("columns", "sampling_rate", "units"):
        refused(rf"analyze\(\) has no option '{name}'; it belongs to reading=", ms.analyze, "x.csv", **{name: 1})
