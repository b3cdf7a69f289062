"""The face: what `import modalscope as ms` offers, what it costs, and what became of earlier names."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import modalscope as ms

#: What scripts, notebooks and the command line rely on.
PROMISED = [
    "DataError",
    "FrequencyResponse",
    "Geometry",
    "ImpulseResponse",
    "ModalModel",
    "Note",
    "Records",
    "Signals",
    "StabilizationDiagram",
    "StateSpace",
    "Comparison",
    "Dwell",
    "EquationsOfMotion",
    "Identification",
    "from_frame",
    "read",
    "write",
    "merge",
    "estimate_correlation",
    "estimate_frf",
    "estimate_markov",
    "methods",
    "identify",
    "realize",
    "stabilize",
    "select",
    "merge_bands",
    "compare",
    "report",
    "mac",
    "tuned_dwell",
    "place",
    "next_measurement",
    "prepare",
    "factor",
    "fit_residues",
    "equations_of_motion",
    "first_order_form",
    "indicators",
    "plot",
    "preprocess",
    "systems",
]


def fresh(program: str) -> str:
    """Run a program in a Python of its own and return what it prints."""
    command = [sys.executable, "-W", "error", "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_every_promised_name_is_there() -> None:
    assert set(PROMISED) <= set(ms.__all__)
    assert set(ms.__all__) <= set(dir(ms))
    for name in ms.__all__:
        assert getattr(ms, name) is not None


def test_type_checkers_see_the_names_in_the_modules_that_they_are_loaded_from() -> None:
    tree = ast.parse(Path(ms.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.asname: f"{node.module}.{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(seen) == ms.__all__
    for name, place in seen.items():
        module, _, attribute = place.rpartition(".")
        assert getattr(import_module(module), attribute) is getattr(ms, name)


def test_importing_the_package_loads_no_numerical_library() -> None:
    heavy = "[m for m in ('numpy', 'scipy', 'matplotlib', 'tqdm') if m in sys.modules]"
    assert fresh(f"import sys, modalscope, modalscope.interfaces.cli; print({heavy})") == "[]"


@pytest.mark.slow
def test_namespaces_need_no_import_of_their_own() -> None:
    asked = "ms.plot.stabilization, ms.systems.chain5, ms.indicators.cmif, ms.preprocess.examine"
    assert fresh(f"import modalscope as ms; print(len([{asked}]))") == "4"


@pytest.mark.slow
def test_pairing_is_loaded_when_poles_are_paired_and_not_before() -> None:
    assert (
        fresh("import sys, modalscope as ms; ms.stabilize; ms.compare; print('scipy.optimize' in sys.modules)")
        == "False"
    )


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("cmif", "indicators"),
        ("mmif", "indicators"),
        ("decomposition", "preprocess"),
        ("examine", "preprocess"),
        ("filter_band", "preprocess"),
        ("half_spectra", "preprocess"),
    ],
)
def test_a_name_that_moved_works_and_tells_its_new_place(name: str, place: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"modalscope\.{name} is now modalscope\.{place}\.{name}"):
        found = getattr(ms, name)
    assert found is getattr(getattr(ms, place), name)
    assert name not in ms.__all__


def test_a_name_that_was_never_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        ms.nonsense  # noqa: B018


#: Names of the face, and their places.
NAMESPACES = {
    "data": "data",
    "doctor": "signals.doctor",
    "indicators": "data.indicators",
    "io": "io",
    "likelihood": "selection.likelihood",
    "monitoring": "analysis.monitoring",
    "numerics": "numerics",
    "plot": "interfaces.plot",
    "preprocess": "signals.preprocess",
    "systems": "systems",
}

#: What is imported of each, in one Python that forgets modalscope in between: that of others is loaded once.
IMPORTED = """
import sys
finders = list(sys.meta_path)
for name, place in NAMESPACES.items():
    exec(f'''
import modalscope.{name}
from modalscope import {name} as given
import modalscope.{place} as room
assert given is modalscope.{name} is room, given
assert room.__spec__.name == room.__name__ == "modalscope.{place}"
print(name, all(getattr(given, each) is getattr(room, each) for each in getattr(room, "__all__", ())))
''')
    for each in [each for each in sys.modules if each.partition(".")[0] == "modalscope"]:
        del sys.modules[each]
    sys.meta_path[:] = finders
from modalscope.plot.web import alive
from modalscope.interfaces.plot.web import alive as own
print("a module of one", alive is own)
"""


FEW = {"doctor", "plot", "systems"}


@pytest.mark.parametrize(
    "names", [FEW, pytest.param(NAMESPACES.keys() - FEW, marks=pytest.mark.slow)], ids=["few", "others"]
)
def test_a_namespace_is_imported_by_its_name_and_by_its_place_and_a_module_of_it_is_no_second_copy(
    names: set[str],
) -> None:
    said = fresh(f"NAMESPACES = { {name: NAMESPACES[name] for name in sorted(names)} }\n{IMPORTED}").splitlines()
    assert said == [f"{name} True" for name in (*sorted(names), "a module of one")]
