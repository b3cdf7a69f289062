"""Measure the house: modules, lines, lines of code, circles of imports, and its budgets. `python -m tools.house` prints them.

Imports inside functions count, those for types and those of a package's `__init__` too.
"""

from __future__ import annotations

import ast
import gc
import io
import re
import subprocess
import sys
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

SOURCE = Path(__file__).resolve().parents[1] / "src"

#: Where the reading path is listed.
ARCHITECTURE = Path(__file__).resolve().parents[1] / "ARCHITECTURE.md"

#: The most that each measure of the house may be.
BUDGETS = Path(__file__).with_name("budgets.toml")


def modules(source: Path = SOURCE) -> dict[str, Path]:
    """Return the file of every module by its dotted name."""
    files = sorted(source.rglob("*.py"))
    return {".".join(f.relative_to(source).with_suffix("").parts).removesuffix(".__init__"): f for f in files}


def _statements(node: ast.AST) -> Iterator[ast.stmt]:
    """Return all statements below a node, those inside functions and under `if TYPE_CHECKING` too; no expression is entered."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        for child in getattr(node, field, ()):
            if isinstance(child, ast.stmt):
                yield child
            yield from _statements(child)


def parsed(text: str) -> ast.Module:
    """Return the tree of a text; three quarters of the time would go into looking for garbage among its nodes."""
    looking = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(text)
    finally:
        if looking:
            gc.enable()


@cache
def _silent(text: str) -> tuple[ast.stmt, ...]:
    """Return the imports of a text, and the statements that are a text alone."""

    def holds(node: ast.stmt) -> bool:
        return isinstance(node, ast.Import | ast.ImportFrom) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )

    return tuple(filter(holds, _statements(parsed(text))))


def imported(text: str, known: Mapping[str, object]) -> set[str]:
    r"""Return the modules among the known ones that a text imports.

    Examples
    --------
    >>> sorted(imported("from a import b, c\nimport a.d", {"a": 1, "a.b": 1, "a.d": 1}))
    ['a', 'a.b', 'a.d']
    """
    found: set[str] = set()
    for statement in _silent(text):
        if isinstance(statement, ast.Import):
            found.update(name.name for name in statement.names)
        elif isinstance(statement, ast.ImportFrom) and statement.module:
            full = {f"{statement.module}.{name.name}" for name in statement.names}
            found.update(full & known.keys())
            if not full <= known.keys():
                found.add(statement.module)
    return found & known.keys()


def circles(imports: Mapping[str, set[str]]) -> list[list[str]]:
    """Return the groups of modules that import each other, by Tarjan's algorithm.

    Examples
    --------
    >>> circles({"a": {"b"}, "b": {"c"}, "c": {"b"}})
    [['b', 'c']]
    """
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        number[name] = lowest[name] = len(number)
        stack.append(name)
        for other in imports[name]:
            if other not in number:
                visit(other)
            if other in stack:
                lowest[name] = min(lowest[name], lowest[other])
        if lowest[name] == number[name]:
            place = stack.index(name)
            group = stack[place:]
            del stack[place:]
            if len(group) > 1:
                found.append(sorted(group))

    for name in imports:
        if name not in number:
            visit(name)
    return found


def code_lines(text: str) -> int:
    r"""Return the lines that hold code: no docstring, comment, blank line or import.

    Examples
    --------
    >>> code_lines('"A text."\nimport a\n\n# why\nx = (1,\n     2)\n')
    2
    """
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    silent = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines = {n for t in tokens if t.type not in silent for n in range(t.start[0], t.end[0] + 1)}
    for node in _silent(text):
        lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


class Measure(NamedTuple):
    """What is measured of the house, and the most it may be."""

    name: str
    found: int
    most: int


def room_of(module: str) -> str:
    """Return the room of a module: the first package below the root; modules of the root itself have the root's name.

    Examples
    --------
    >>> room_of("modalscope.signals.doctor.examine"), room_of("modalscope")
    ('signals', 'modalscope')
    """
    inner = module.removesuffix(".__main__").split(".")[1:]
    return inner[0] if inner else "modalscope"


def arrows(imports: Mapping[str, set[str]]) -> set[tuple[str, str]]:
    """Return which rooms import which others, the face left out: it names all of them.

    Examples
    --------
    >>> arrows({"modalscope.io.npz": {"modalscope.data", "modalscope.io"}, "modalscope.data": set()})
    {('io', 'data')}
    """
    pairs = {(room_of(module), room_of(other)) for module, others in imports.items() for other in others}
    return {(one, other) for one, other in pairs if one != other and "modalscope" not in (one, other)}


def reading_path() -> list[str]:
    """Return the modules of the reading path, in the order in which ARCHITECTURE lists them."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    section = text.partition("## The reading path")[2].partition("\n## ")[0]
    files = re.findall(r"^\| `(identification/\S+)\.py` \|", section, flags=re.MULTILINE)
    return [f"modalscope.{file.replace('/', '.')}" for file in files]


def leaving(path: list[str], imports: Mapping[str, set[str]]) -> set[str]:
    """Return what modules of a path import beyond themselves, the data and the numerics.

    Examples
    --------
    >>> leaving(["m.a", "m.b"], {"m.a": {"m.b", "modalscope.data.modes"}, "m.b": {"m.c"}})
    {'m.c'}
    """
    return {o for m in path for o in imports[m] if room_of(o) not in ("data", "numerics")} - set(path)


def _said_by(program: str) -> list[int]:
    """Return the numbers that a program prints in an interpreter of its own."""
    run = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    return [int(number) for number in run.stdout.split()]


#: A small test of responses, and what reading and analysing it loads, or identifying it at one order runs.
_RESPONSES = """
import subprocess, sys, tempfile, modalscope as ms
from pathlib import Path
from modalscope.systems import chain5
made = chain5().frequency_response([0.01 * k for k in range(30, 751, 2)], noise=0.01, seed=0)
"""
_LOADED = """
code = "import sys, modalscope as ms; ms.analyze(sys.argv[1]); print(sum(m.startswith('modalscope') for m in sys.modules))"
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "test.uff"
    ms.write(path, made)
    print(subprocess.run([sys.executable, "-c", code, path], check=True, capture_output=True, text=True).stdout)
"""
_RUN = """
ms.identify(made, order=10)
seen = set()
sys.setprofile(lambda frame, event, _: event == "call" and seen.add(frame.f_code))
ms.identify(made, order=10)
sys.setprofile(None)
inner = ("<lambda>", "<genexpr>", "<listcomp>", "<setcomp>", "<dictcomp>")
print(sum("modalscope" in code.co_filename and code.co_name not in inner for code in seen))
"""


def measures() -> list[Measure]:
    """Return what `tools/budgets.toml` holds, with what is found: lines of code, rooms, arrows, modules loaded, functions run."""
    most = tomllib.loads(BUDGETS.read_text(encoding="utf-8"))
    files = modules()
    texts = {name: path.read_text(encoding="utf-8") for name, path in files.items()}
    imports = {name: imported(text, files) for name, text in texts.items()}
    drawn, path = arrows(imports), reading_path()
    core = "modalscope.identification"
    plain = [name for name in texts if name.startswith(core) and not name.startswith(f"{core}.fast")]
    lines_of = {name: code_lines(text) for name, text in texts.items()}
    code: Counter[str] = Counter()
    for name, lines in lines_of.items():
        code[room_of(name)] += lines
    loaded, run = _said_by(_RESPONSES + _LOADED + _RUN)
    found = {
        "lines of code": code.total(),
        "rooms": len(code) - 1,
        "arrows between rooms": len(drawn),
        "modules of the reading path": len(path),
        "lines of code of the reading path": sum(lines_of[name] for name in path),
        "imports that leave the reading path": len(leaving(path, imports)),
        "lines of identification without its faster forms": sum(texts[name].count("\n") for name in plain),
        "modules that reading and analysing responses loads": loaded,
        "functions that one identification runs": run,
    } | {f"lines of code of {room}": lines for room, lines in code.items()}
    return [Measure(name, found.get(name, 0), figure) for name, figure in most.items()]


def main() -> None:
    """Print the measures, a line a package, the budgets and every circle; with `--budgets` these alone."""
    if "--budgets" not in sys.argv[1:]:
        _print_packages()
    for measure in measures():
        print(f"{measure.name:52s} {measure.found:6d} of {measure.most}")


def _print_packages() -> None:
    files = modules()
    texts = {name: path.read_text(encoding="utf-8") for name, path in files.items()}
    packages: dict[str, list[str]] = {}
    for name in files:
        packages.setdefault(
            ".".join(name.split(".")[:2]) if files[name].parent != SOURCE / "modalscope" else "modalscope", []
        ).append(name)
    print(f"{'package':32s} {'modules':>8s} {'lines':>8s} {'code':>8s}")
    for package, names in [*sorted(packages.items()), ("all", list(files))]:
        lines = sum(texts[n].count("\n") for n in names)
        print(f"{package:32s} {len(names):8d} {lines:8d} {sum(code_lines(texts[n]) for n in names):8d}")
    for circle in circles({name: imported(text, files) for name, text in texts.items()}):
        print("circle: " + ", ".join(circle))


if __name__ == "__main__":
    main()
