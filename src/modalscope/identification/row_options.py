"""The options of one row, from what was asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from modalscope.identification.method import Method
from modalscope.identification.options import AllOptions, Options
from modalscope.identification.table import methods
from modalscope.model.checks import DataError, check_choice
from modalscope.model.errors import check_option_names

__all__ = ["check_form", "options_of"]


def options_of(row: Method, given: Mapping[str, Any]) -> Options:
    """Return the row's own options; what it has no use for is refused, with the rows that have it.

    Parameters
    ----------
    row : Method
    given : mapping
        None stands for what is not given.
    """
    own = {f.name for f in fields(row.options_type)}
    chosen = {name: value for name, value in given.items() if value is not None}
    for name, value in row.fixed.items():
        if chosen.get(name, value) != value:
            raise DataError(
                f"{name}={chosen[name]!r} was asked of method {row}",
                f"{name}={value!r} is what makes that row",
                "Leave the option out, or choose another method.",
            )
    asked = {**row.fixed, **chosen}
    check_option_names(str(row), asked, AllOptions.__annotations__)
    for name in asked:
        if name not in own:
            having = dict.fromkeys(str(m) for m in methods() if name in {f.name for f in fields(m.options_type)})
            raise DataError(
                f"option {name!r} was asked of method {row}",
                row.options_type.why_not,
                f"Leave it out, or choose one of the methods that have it: {', '.join(having)}.",
            )
    return row.options_type(**asked)


def check_form(row: Method, form: str | None) -> None:
    """Raise when a form was asked that a row does not have.

    Parameters
    ----------
    row : Method
    form : str or None
    """
    if form is None:
        return
    check_choice("form", form, ("observable", "controllable", "smaller"))
    allowed = (*row.forms, "smaller") if len(row.forms) > 1 else row.forms
    if form not in allowed:
        raise DataError(
            f"form={form!r} of method {row.name!r} in domain {row.domain!r} was asked",
            f"it has only {' and '.join(allowed)}: its columns are lines or times, in which the state matrix does not appear as B, AB, ...",
            f"Use form={allowed[0]!r}, or a method in the time domain.",
        )
