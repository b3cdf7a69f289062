"""Import optional packages, and name the extra that installs a missing one."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from modalscope.numerics.errors import DataError


def optional_package(asked: str, package: str, extra: str, name: str | None = None) -> Any:
    """Return an optional package, or say which extra of modalscope brings it.

    `asked`: what it is needed for. `package`: the name that is imported. `name`: what the package is called, when that is not the name
    that is imported.

    Raises `DataError`: it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        raise DataError(
            f"{asked} was asked", f"{name or package} is not installed", f"Run: pip install 'modalscope[{extra}]'"
        ) from None
