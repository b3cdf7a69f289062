"""The same analysis again: to the last bit, from a document, a file or a script, and never on other data unasked."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.reporting.record import identification_script, result_script, stabilization_script

RNG = np.random.default_rng(1)
CHAIN = ms.systems.chain5()
SAMPLES = CHAIN.impulse_response(200, noise=0.02, seed=0)
LINES = ms.systems.add_noise(CHAIN.frequency_response(np.linspace(0.3, 8, 120), quantity="displacement"), 0.02, 0)
AMBIENT = CHAIN.simulate(inputs="ambient", samples=4000, sampling_rate=20.0, noise=0.02, seed=0)
DRIVEN = CHAIN.simulate(samples=1000, sampling_rate=20.0, noise=0.02, seed=0)

#: Data and choices: every row of the table, records, bands, channels left out, initial values, arrays among the options.
CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    **{
        f"{m.name} {m.domain}": (
            AMBIENT
            if m.takes.name == "PAST"
            else DRIVEN
            if m.takes.name in ("DRIVEN", "RECORDS")
            else LINES
            if m.domain == "s"
            else SAMPLES,
            {"method": m.name, "domain": m.domain, "orders": range(4, 21, 2) if m.name == "wnsf" else range(4, 25, 4)},
        )
        for m in ms.methods()
    },
    "ambient in a band": (AMBIENT, {"band": (0.4, 7.0), "orders": range(8, 25, 4)}),
    "driven records": (DRIVEN, {"orders": range(8, 21, 4)}),
    "a channel left out": (LINES, {"exclude": [LINES.output_dofs[1]], "band": (0.5, 7), "orders": range(4, 21, 4)}),
    "structure at rest": (LINES, {"method": "era", "domain": "s", "initial_values": "rest"}),
    "known initial terms": (LINES, {"method": "era", "domain": "s", "initial_values": np.zeros((1, 4, 2))}),
    "weights of the lines": (LINES, {"weights": 1 / (1 + np.arange(120.0) / 7), "orders": range(4, 21, 4)}),
    "uneven shifts": (
        SAMPLES,
        {"method": "era", "row_shifts": [0, 1, 3, 4, 6, 9, 10, 12, 15, 20], "block_columns": 60},
    ),
    "few orders": (SAMPLES, {"orders": [4, 9, 14], "block_rows": 12}),
}


def equal(a: ms.ModalModel, b: ms.ModalModel) -> None:
    for name in ("poles", "shapes", "participation", "frequencies_spread", "damping_ratios_spread"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def run(script: str, file: Path) -> dict[str, Any]:
    """Run a script of a report beside its data; where it writes its report does not matter."""
    names: dict[str, Any] = {}
    with contextlib.chdir(file.parent), contextlib.redirect_stdout(io.StringIO()):
        exec(compile(script.replace("ms.report(", "("), "script", "exec"), names)
    return names


@pytest.fixture
def stored(tmp_path: Path) -> Callable[[Any], Path]:
    def store(data: Any) -> Path:
        path = tmp_path / "data.npz"
        ms.write(path, data)
        return path

    return store


#: Rows that take the options of another one of these cases.
LIKE_OTHERS = (
    "era z",
    "polyreference z",
    "alternate s",
    "least_squares z",
    "least_squares s",
    "ssi-cva time",
    "aaa z",
    "vector-fitting z",
)


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in CASES if case not in LIKE_OTHERS])
def test_script_document_and_file_repeat_the_result_to_the_last_bit(case: str, stored: Callable[[Any], Path]) -> None:
    data, choices = CASES[case]
    file = stored(data)
    result = ms.analyze(file, **choices)
    assert len(result.modes)
    equal(run(result_script(result), file)["result"].modes, result.modes)
    written = file.with_suffix(".json")
    ms.write(written, result)
    equal(ms.replay(written).modes, result.modes)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_resolved_settings_repeat_what_the_choices_gave(case: str, stored: Callable[[Any], Path]) -> None:
    """All sizes chosen, nothing left to the program: the script of a diagram, and `identify(**settings)`."""
    data, choices = CASES[case]
    file = stored(data)
    thing = ms.read(file)
    diagram = ms.stabilize(thing, **choices)
    again = run(stabilization_script(diagram, str(file)), file)["diagram"]
    for name in ("poles", "shapes", "fit_errors", "singular_values"):
        np.testing.assert_array_equal(getattr(again, name), getattr(diagram, name))
    few = {name: value for name, value in choices.items() if name != "orders"}
    found = ms.identify(thing, order=diagram.orders[-1], **few)
    equal_model = run(identification_script(found, str(file)), file)["found"]
    np.testing.assert_array_equal(equal_model.modes.poles, found.modes.poles)
    np.testing.assert_array_equal(equal_model.state_space.A, found.state_space.A)


def test_data_without_a_file_are_known_by_their_numbers() -> None:
    result = ms.analyze(SAMPLES, orders=[10, 12])
    equal(ms.replay(result.analysis, SAMPLES).modes, result.modes)
    other = replace(SAMPLES, values=SAMPLES.values * 1.5)
    with pytest.raises(ms.DataError, match="these are others"):
        ms.replay(result.analysis, other)
    assert len(ms.replay(result.analysis, other, force=True).modes) == len(result.modes)
    with pytest.raises(ms.DataError, match="names no file"):
        ms.replay(result.analysis)


def test_a_file_that_has_changed_is_refused(stored: Callable[[Any], Path]) -> None:
    file = stored(SAMPLES)
    result = ms.analyze(file, orders=[10, 12])
    thing = ms.read(file)
    equal(ms.replay(result.analysis, thing).modes, result.modes)
    ms.write(file, replace(SAMPLES, values=SAMPLES.values * 1.5))
    with pytest.raises(ms.DataError, match="hash differs"):
        ms.replay(result.analysis)
    assert len(ms.replay(result.analysis, force=True).modes) == 5


def test_a_document_is_a_file_of_its_own(tmp_path: Path) -> None:
    document = ms.analyze(SAMPLES, method="era", weights=None, orders=range(2, 21, 2)).analysis
    path = tmp_path / "x.analysis.json"
    ms.write(path, document)
    assert json.loads(path.read_text())["analysis"]["orders"] == list(range(2, 21, 2))
    equal(ms.replay(path, SAMPLES).modes, ms.replay(document, SAMPLES).modes)
    later = json.loads(path.read_text())
    later["analysis"]["schema"] = 3
    path.write_text(json.dumps(later))
    with pytest.raises(ms.DataError, match="reads up to 2"):
        ms.replay(path, SAMPLES)
    path.write_text("{}")
    with pytest.raises(ms.DataError, match='has no "analysis"'):
        ms.replay(path, SAMPLES)
    with pytest.raises(ms.DataError, match="there is no such file"):
        ms.replay(tmp_path / "none.json", SAMPLES)


def test_data_of_several_files_are_those_of_the_document_while_the_files_are(tmp_path: Path) -> None:
    places = [tmp_path / "1.npz", tmp_path / "2.npz"]
    for k, place in enumerate(places):
        ms.write(place, LINES.select(inputs=[k]))
    found = ms.analyze(places, method="era", domain="z", orders=(8, 10, 12), refine=False)
    merged = ms.merge([ms.read(place) for place in places])
    equal(ms.replay(found.analysis, merged).modes, found.modes)
    with pytest.raises(ms.DataError, match="these are others"):
        ms.replay(found.analysis, replace(merged, values=2 * merged.values))
    ms.write(places[1], LINES.select(inputs=[0]))
    with pytest.raises(ms.DataError, match="these are others"):
        ms.replay(found.analysis, merged)


def test_a_document_of_0_2_0_is_repeated_by_later_rules_and_what_differs_is_listed(tmp_path: Path) -> None:
    data = tmp_path / "data.npz"
    ms.write(data, SAMPLES)
    result = ms.analyze(data, orders=[10, 12])
    path = tmp_path / "result.json"
    ms.write(path, result.modes, result=result)
    stored = json.loads(path.read_text())
    assert stored["analysis"]["schema"] == 2
    assert not [note for note in ms.replay(path).notes if note.kind == "later rules"]
    stored["analysis"] |= {"schema": 1, "version": "0.2.0"}
    path.write_text(json.dumps(stored))
    again = ms.replay(path)
    (note,) = (note for note in again.notes if note.kind == "later rules")
    assert note.text.startswith("Document of modalscope 0.2.0: repeated with later rules")
    assert note.text.endswith("; the same modes")
    assert again.analysis.schema == 2
    equal(again.modes, result.modes)
    moved = stored["modes"][1]
    moved["pole"]["imag"] *= 1.3
    moved["frequency_hz"] *= 1.3
    path.write_text(json.dumps(stored))
    (note,) = (note for note in ms.replay(path).notes if note.kind == "later rules")
    assert note.numbers == {"gone": 1, "new": 1}
    assert f"new: {result.modes.frequencies[1]:.5g} Hz" in note.text
    (note,) = (n for n in ms.replay(replace(result.analysis, schema=1)).notes if n.kind == "later rules")
    assert note.text.endswith("selecting modes")


@pytest.mark.slow
def test_a_measured_test_is_its_name_its_file_and_its_data(tmp_path: Path) -> None:
    data = ms.datasets.load("beam_hammer")
    asked: dict[str, Any] = {"band": (150, 200), "orders": [4, 6], "refine": False}
    of_data, of_name = ms.analyze(data, **asked), ms.analyze("beam_hammer", **asked)
    assert of_name.analysis.files[0].path == "beam_hammer"
    for first, given in ((of_data, "beam_hammer"), (of_name, None), (of_name, data.source_path)):
        ms.write(tmp_path / "modes.json", first)
        equal(ms.replay(tmp_path / "modes.json", given).modes, of_data.modes)
    with pytest.raises(ms.DataError, match="these are others"):
        ms.replay(of_data.analysis, LINES)
