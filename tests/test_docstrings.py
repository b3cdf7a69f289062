"""What `modalscope` offers is described: every public name has a numpydoc docstring that names its parameters."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import modalscope

#: `**options` are described in words, by reference to the verb that takes them.
_NAMED = (
    inspect.Parameter.POSITIONAL_ONLY,
    inspect.Parameter.POSITIONAL_OR_KEYWORD,
    inspect.Parameter.KEYWORD_ONLY,
    inspect.Parameter.VAR_KEYWORD,
)


def public_callables() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield classes, functions and the public methods of classes, by name."""
    for name in modalscope.__all__:
        found = getattr(modalscope, name)
        members = {f"{name}.{part}": getattr(found, part) for part in getattr(found, "__all__", ())}
        for label, thing in (members or {name: found}).items():
            if not callable(thing):
                continue
            yield label, thing
            if inspect.isclass(thing):
                methods = inspect.getmembers(thing, lambda m: inspect.isfunction(m) or inspect.ismethod(m))
                yield from ((f"{label}.{part}", method) for part, method in methods if not part.startswith("_"))


CALLABLES = dict(public_callables())


def extended() -> dict[Callable[..., Any], list[Callable[..., Any]]]:
    """Return for each public method those of the same name in the classes that its own extends: what they describe need not be repeated."""
    classes = [thing for thing in CALLABLES.values() if inspect.isclass(thing)]
    return {
        vars(kind)[name]: [vars(base)[name] for base in kind.__mro__[1:-1] if inspect.isfunction(vars(base).get(name))]
        for kind in classes
        for name in vars(kind)
        if inspect.isfunction(vars(kind)[name])
    }


EXTENDED = extended()


def described(thing: Callable[..., Any]) -> set[str]:
    """Return the names in the Parameters section of a docstring; a named tuple may call it Attributes."""
    section = re.search(
        r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=^\S[^\n]*\n-+$|\Z)", inspect.getdoc(thing) or "", re.S | re.M
    )
    heads = [line for line in (section[1].splitlines() if section else ()) if line and not line[0].isspace()]
    return {name.strip().lstrip("*") for head in heads for name in head.partition(" : ")[0].split(",")}


def taken(thing: Callable[..., Any]) -> set[str]:
    """Return the names of the parameters that a caller may give."""
    parameters = inspect.signature(thing).parameters.values()
    return {p.name for p in parameters if p.kind in _NAMED and p.name not in ("self", "cls")}


def inherited(thing: Callable[..., Any]) -> set[str]:
    """Return what a noun's docstring leaves to those of the classes that it extends."""
    if inspect.isclass(thing):
        return set().union(*(described(base) for base in thing.__mro__[1:-1]))
    return set().union(*(described(other) for other in EXTENDED.get(thing, ())))


def test_a_docstring_opens_with_one_sentence_on_a_line_of_its_own() -> None:
    texts = {name: inspect.getdoc(thing) or "" for name, thing in CALLABLES.items()}
    assert len(texts) > 300
    assert [name for name, text in texts.items() if not re.match(r"[^\n]+[.?]\n?(\n|\Z)", text)] == []


def test_every_parameter_is_described() -> None:
    missing = {name: taken(thing) - described(thing) - inherited(thing) for name, thing in CALLABLES.items()}
    assert {name: names for name, names in missing.items() if names} == {}


def test_no_parameter_is_described_that_is_not_there() -> None:
    """Options that verbs hand on by `**options` may be described by their names."""

    def open_ended(thing: Callable[..., Any]) -> bool:
        return any(p.kind is p.VAR_KEYWORD for p in inspect.signature(thing).parameters.values())

    surplus = {name: described(thing) - taken(thing) for name, thing in CALLABLES.items() if not open_ended(thing)}
    assert {name: names for name, names in surplus.items() if names} == {}


def test_properties_say_what_they_are() -> None:
    classes = [thing for thing in CALLABLES.values() if inspect.isclass(thing)]
    silent = [
        f"{kind.__name__}.{name}"
        for kind in classes
        for name, _ in inspect.getmembers(kind, lambda m: isinstance(m, property))
        if not name.startswith("_") and not inspect.getdoc(inspect.getattr_static(kind, name))
    ]
    assert not silent
