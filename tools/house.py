"""Measure the house: modules, lines, lines of code, and circles of imports. `python -m tools.house` prints them.

Imports inside functions count, those for types and those of a package's `__init__` too.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator, Mapping
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"


def modules(source: Path = SOURCE) -> dict[str, Path]:
    """Return the file of every module by its dotted name."""
    files = sorted(source.rglob("*.py"))
    return {".".join(f.relative_to(source).with_suffix("").parts).removesuffix(".__init__"): f for f in files}


def _statements(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Return all imports, those inside functions and under `if TYPE_CHECKING` too."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        else:
            yield from _statements(child)


def imported(text: str, known: Mapping[str, object]) -> set[str]:
    r"""Return the modules among the known ones that a text imports.

    Examples
    --------
    >>> sorted(imported("from a import b, c\nimport a.d", {"a": 1, "a.b": 1, "a.d": 1}))
    ['a', 'a.b', 'a.d']
    """
    found: set[str] = set()
    for statement in _statements(ast.parse(text)):
        if isinstance(statement, ast.Import):
            found.update(name.name for name in statement.names)
        elif statement.module:
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
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        ):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def main() -> None:
    """Print the measures, a line a package, and every circle."""
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
