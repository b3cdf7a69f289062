"""Count the places outside the table and the data matrices that ask for a class, a tag or a name instead of asking the row.

    python -m tools.branches

A row of the table, a data matrix, a realization and a response say themselves what is to be done; a stage that asks which of them it has
before it goes on is a branch. Counted are, in the packages from the realizations up to the comparison:

- `isinstance(x, C)` with C a data matrix, a realization, or one of the two kinds of response;
- `==`, `!=`, `in` and `not in` between an attribute `name`, `domain`, `takes`, `method` or `kind` (or a variable `method`, `domain`) and
  a text that names a row, a domain or a kind, or a member of `Takes`.

The table (what rows are made of: `TABLE` below) and `matrices/` may ask.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from modalscope.data.channels import KINDS
from modalscope.identification.method import Takes
from modalscope.identification.method_names import methods
from modalscope.identification.table_beyond import DOMAINS

SOURCE = Path(__file__).resolve().parents[1] / "src" / "modalscope"

#: Packages whose stages are counted.
STAGES = (
    *("identification", "identification/realizations", "identification/modal"),
    *("selection/judging", "analysis/comparing", "analysis/workflow"),
)

#: What rows of the table are made of.
TABLE = {
    f"identification/{name}.py"
    for name in ("table", "method", "options", "orders", "suits", "method_names", "table_beyond", "matrices_beyond")
}

#: Classes that nobody asks for.
CLASSES = {"FrequencyResponse", "ImpulseResponse", "DataMatrix", "Realization"}

#: Attributes and variables that tell rows, domains and kinds apart.
ASKED = {"name", "domain", "takes", "method", "kind", "origin", "factors"}

WORDS = {m.name for m in methods()} | {a for m in methods() for a in m.aliases} | set(DOMAINS) | set(KINDS)


def classes_of(folder: str) -> set[str]:
    """Return the classes that the modules of a folder define."""
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in (SOURCE / folder).glob("*.py"))
    return {node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}


def branches(tree: ast.AST, classes: set[str]) -> Iterator[tuple[int, str]]:
    """Yield line and text of every branch in a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance" and len(node.args) == 2:
            named = {n.id for n in ast.walk(node.args[1]) if isinstance(n, ast.Name)}
            if named & classes:
                yield node.lineno, ast.unparse(node)
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            if any(_asked(side) for side in sides) and any(_names_one(side) for side in sides):
                yield node.lineno, ast.unparse(node)


def _asked(node: ast.expr) -> bool:
    return (isinstance(node, ast.Attribute) and node.attr in ASKED) or (
        isinstance(node, ast.Name) and node.id in ("method", "domain")
    )


def _names_one(node: ast.expr) -> bool:
    """Whether an expression holds the name of a row, a domain or a kind, or a member of `Takes`."""
    texts = {n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    members = {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute) and ast.unparse(n.value) == "Takes"}
    return bool(texts & WORDS or members & set(Takes.__members__))


def found() -> list[str]:
    """Return all branches, a line each."""
    classes = (
        CLASSES
        | classes_of("identification/matrices")
        | classes_of("identification/realizations")
        | classes_of("extras")
    )
    lines = []
    for path in sorted(p for stage in STAGES for p in (SOURCE / stage).glob("*.py")):
        place = path.relative_to(SOURCE).as_posix()
        if place not in TABLE:
            tree = ast.parse(path.read_text(encoding="utf-8"))
            lines += [f"{place}:{line}: {text}" for line, text in sorted(branches(tree, classes))]
    return lines


if __name__ == "__main__":
    everything = found()
    print("\n".join([*everything, f"{len(everything)} branches on class, tag or name outside the table and blocks"]))
    sys.exit(bool(everything))
