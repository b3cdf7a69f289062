"""The JSON of a result is what docs/schema says, and what docs/scripts.md says of it runs as written."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.interfaces.cli.process import EXIT_PARTLY, EXIT_WRONG
from modalscope.interfaces.cli.watch import EXIT_ALARM
from modalscope.systems import chain5
from tests.support import ROOT

jsonschema = pytest.importorskip("jsonschema")
SCHEMA = json.loads((ROOT / "docs" / "schema" / "result.schema.json").read_text(encoding="utf-8"))
PAGE = (ROOT / "docs" / "scripts.md").read_text(encoding="utf-8")


def faults(document: Any) -> list[str]:
    return [
        f"{'/'.join(map(str, fault.path))}: {fault.message}"
        for fault in jsonschema.Draft202012Validator(SCHEMA).iter_errors(document)
    ]


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A result with modes, candidates left out, notes and the document of its analysis."""
    clean = chain5().state_space().frequency_response(np.linspace(0.2, 6.0, 150))
    noise = np.random.default_rng(1).standard_normal((2, *clean.values.shape)) * 0.01 * np.abs(clean.values).max()
    noisy = ms.FrequencyResponse(frequencies=clean.frequencies, values=clean.values + noise[0] + 1j * noise[1])
    path = tmp_path_factory.mktemp("schema") / "modes.json"
    ms.write(path, ms.analyze(noisy, orders=range(2, 15, 2)))
    return json.loads(path.read_text(encoding="utf-8"))


def test_a_result_is_as_the_schema_says(document: Any) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert document["modes"]
    assert document["notes"]
    assert document["analysis"]
    assert faults(document) == []


@pytest.mark.parametrize(
    ("where", "wrong"),
    [
        (("modes", 0, "frequency_hz"), None),
        (("modes", 0, "interval_95", "damping_ratio"), [0.01]),
        (("modes", 0, "further"), 1.0),
        (("data", "units"), "m/s^2"),
        (("further",), 1.0),
    ],
    ids=lambda value: "/".join(map(str, value)) if isinstance(value, tuple) else "",
)
def test_a_document_of_another_form_is_refused(document: Any, where: tuple[Any, ...], wrong: Any) -> None:
    changed = json.loads(json.dumps(document))
    inner = changed
    for step in where[:-1]:
        inner = inner[step]
    inner[where[-1]] = wrong
    assert len(faults(changed)) == 1


@pytest.mark.parametrize("where", [(), ("modes", 0), ("data",)], ids=["result", "mode", "data"])
def test_an_entry_that_is_missing_is_noticed(document: Any, where: tuple[Any, ...]) -> None:
    inner = document
    for step in where:
        inner = inner[step]
    for name in set(inner) - {"file"}:
        changed = json.loads(json.dumps(document))
        place = changed
        for step in where:
            place = place[step]
        del place[name]
        assert faults(changed), name


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the file that the page names."""
    folder = tmp_path_factory.mktemp("scripts")
    shutil.copy(ROOT / "examples" / "beam_hammer" / "beam_hammer.uff", folder / "test.uff")
    return folder


def ran(place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    return subprocess.run(words, cwd=place, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_commands_of_the_page_give_what_the_schema_says(place: Path) -> None:
    (block,) = re.findall(r"^```text\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    for line in block.splitlines():
        done = ran(place, *shlex.split(line, comments=True))
        assert done.returncode == 0, done.stderr
        if "-o -" in line:
            assert faults(json.loads(done.stdout)) == []
    assert faults(json.loads((place / "modes.json").read_text(encoding="utf-8"))) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "program", re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE), ids=["command", "library"]
)
def test_the_programs_of_the_page_run(place: Path, program: str) -> None:
    done = ran(place, sys.executable, "-c", program)
    assert done.returncode == 0, done.stderr


def test_its_exit_statuses_are_those_of_the_commands() -> None:
    stated = {int(number) for cell in re.findall(r"^\| ([\d, ]+) \|", PAGE, re.MULTILINE) for number in cell.split(",")}
    assert stated == {0, 1, EXIT_WRONG, EXIT_ALARM, EXIT_PARTLY, 128 + signal.SIGINT, 128 + signal.SIGTERM}
    assert main(["identify", "missing.uff", "-o", "-"]) == EXIT_WRONG
