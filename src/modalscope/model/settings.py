"""The options that an identification was made with, as one object that every result carries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

__all__ = ["Settings"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Settings:
    """Options by name; those at their default None are left out, so that `identify(data, **settings)` repeats what was done.

    Parameters
    ----------
    band : (float, float), optional
        Lowest and highest frequency in Hz that is used.
    exclude : tuple of labels, optional
        Channels left out.
    route : str, optional
        From records with inputs: "records", "frf", "markov" or "subspace".
    delays : mapping of label to int, optional
        From records with inputs: samples by which outputs come late after the forces, which was taken out; {} for none.
    factorization : {"auto", "dense", "gram", "randomized", "lanczos"}
        The route to the singular vectors.
    """

    band: tuple[float, float] | None = None
    exclude: tuple[Any, ...] | None = None
    route: str | None = None
    delays: Mapping[str, int] | None = None
    factorization: str = "auto"

    def keys(self) -> Iterator[str]:
        """Return the names of the options that are set."""
        return (f.name for f in fields(self) if getattr(self, f.name) is not None)

    def __iter__(self) -> Iterator[str]:
        return self.keys()

    def __getitem__(self, name: str) -> Any:
        if name not in self.keys():
            raise KeyError(name)
        return getattr(self, name)

    def __contains__(self, name: object) -> bool:
        return name in set(self.keys())

    def get(self, name: str, default: Any = None) -> Any:
        """Return an option, or a default where it is not set.

        Parameters
        ----------
        name : str
        default : object, optional
        """
        value = getattr(self, name, None)
        return default if value is None else value

    def items(self) -> list[tuple[str, Any]]:
        """Return names and values of the options that are set."""
        return [(name, getattr(self, name)) for name in self.keys()]
