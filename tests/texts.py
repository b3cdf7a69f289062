"""Collect from the source every text that a user reads, with its kind. `python -m tests.texts [KIND]` prints them side by side.

Kinds: error (the parts of a DataError), note, finding, help (of commands and options), label (of pictures and the report).
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.support import ROOT
from tools.house import parsed

SOURCE = ROOT / "src" / "modalscope"

#: Functions of pictures and of the report whose text arguments are read, and keywords of any function there.
_LABELLING = {
    "set_xlabel",
    "set_ylabel",
    "set_title",
    "headline",
    "aside",
    "paragraph",
    "picture",
    "folded",
    "Section",
    "table",
}
_LABELS = {"title", "xlabel", "ylabel", "label", "caption"}


#: Packages in which any call may hold a text.
_SHOWN = ("plot", "web", "reporting")

#: Functions that make an error.
_MAKING = re.compile(r"def (\w+)\((?:[^()]|\([^()]*\))*\) -> DataError:")

Names = dict[str, list[ast.AST]]


class Text(NamedTuple):
    """One text: where it stands, its kind, and its words; values are {...}."""

    place: str
    kind: str
    words: str


def _resolved(node: ast.AST | None, names: Names) -> list[str]:
    """Return the texts that an expression may give; a name gives those assigned to it in its function or module."""
    if isinstance(node, ast.Constant):
        return [node.value] if isinstance(node.value, str) else []
    if isinstance(node, ast.JoinedStr):
        return ["".join(str(p.value) if isinstance(p, ast.Constant) else "{...}" for p in node.values)]
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        first, second = (_resolved(side, names) or ["{...}"] for side in (node.left, node.right))
        return [a + b for a in first for b in second]
    if isinstance(node, ast.IfExp):
        return _resolved(node.body, names) + _resolved(node.orelse, names)
    if isinstance(node, ast.List):
        return [text for item in node.elts for text in _resolved(item, names)]
    if isinstance(node, ast.Name):
        return [text for value in names.get(node.id, ()) for text in _resolved(value, {})]
    return []


def _units(tree: ast.Module) -> list[ast.stmt]:
    """Return the statements of a module, those of a class in its place."""
    return [unit for part in tree.body for unit in (part.body if isinstance(part, ast.ClassDef) else [part])]


def _assigned(nodes: Iterable[ast.AST]) -> Names:
    """Return the expressions that are assigned to each name, also in tuples."""
    names: Names = {}
    for node in (node for node in nodes if isinstance(node, ast.Assign)):
        for target in node.targets:
            several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            pairs = zip(target.elts, node.value.elts, strict=False) if several else [(target, node.value)]
            for part, value in pairs:
                if isinstance(part, ast.Name):
                    names.setdefault(part.id, []).append(value)
    return names


def _read(call: ast.Call, package: str, errors: set[str]) -> Iterator[tuple[str, ast.AST]]:
    """Yield the arguments of a call that a user reads, with their kinds."""
    name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
    keywords = {word.arg: word.value for word in call.keywords}
    if name in errors:
        yield from (("error", value) for value in (*call.args, *keywords.values()))
    elif name == "Note":
        yield from (("note", value) for value in (*call.args[2:], *filter(None, [keywords.get("text")])))
    elif package == "cli" and (name == "add" or isinstance(call.func, ast.Call)) and len(call.args) == 2:
        yield "help", call.args[1]  # of an option, beside its usage
    elif package in _SHOWN:
        read = call.args[1:] if name == "Section" else call.args if name in _LABELLING else []
        yield from (("label", value) for value in (*read, *(v for k, v in keywords.items() if k in _LABELS)))


def collect(files: Iterable[Path] | None = None) -> list[Text]:
    """Return all texts, by kind and place."""
    written = {path: path.read_text(encoding="utf-8") for path in files or sorted(SOURCE.rglob("*.py"))}
    errors = {"DataError", *(name for text in written.values() for name in _MAKING.findall(text))}
    calls = re.compile(rf"\b(?:{'|'.join(sorted(errors))}|Note)\(")
    listed: list[Text] = []
    texts: set[tuple[str, str]] = set()
    for path, text in written.items():
        place, package = path.relative_to(SOURCE).as_posix(), path.parent.name
        if package not in (*_SHOWN, "cli", "doctor") and not calls.search(text):
            continue
        tree, lines = parsed(text), text.splitlines()
        units = _units(tree)
        constants = _assigned(units)
        for unit in units:
            own = "\n".join(lines[unit.lineno - 1 : unit.end_lineno])
            if package not in (*_SHOWN, "cli") and not calls.search(own):
                continue
            nodes = list(ast.walk(unit))
            names = constants | _assigned(nodes)
            for call in (node for node in nodes if isinstance(node, ast.Call)):
                for kind, value in _read(call, package, errors):
                    texts |= {(kind, words) for words in _resolved(value, names) if " " in words and "<" not in words}
        if place == "signals/doctor/findings.py":
            cells = (node for node in ast.walk(constants["ROWS"][0]) if isinstance(node, ast.Tuple))
            texts |= {("finding", words) for row in cells for cell in row.elts for words in _resolved(cell, constants)}
        if package == "cli" and any(isinstance(unit, ast.FunctionDef) and unit.name == "add" for unit in units):
            texts.add(("help", ast.get_docstring(tree) or ""))
        listed += [Text(place, kind, words) for kind, words in texts if words.strip()]
        texts.clear()
    return sorted(listed, key=lambda text: (text.kind, text.place, text.words))


if __name__ == "__main__":
    for each in collect():
        if each.kind in (sys.argv[1:] or [each.kind]):
            print(f"{each.kind:8s} {each.place:32s} {each.words!r}")
