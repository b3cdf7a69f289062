"""Hold an analysis as a document of all choices, with its version, to be stored, read and repeated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from modalscope.numerics.checks import check_band, check_count, check_each, check_kind, check_number, freeze
from modalscope.numerics.errors import DataError

# The version, as files and reports say it; a test holds it to that of the face and of the project file.

VERSION = "0.2.0"


#: Number of the layout, and of the rules by which modes are chosen; a document of a later one is refused, not guessed at. Documents of
#: layout 1 (0.2.0) are read: what they list today differs where rules have changed, and `replay` says so.
SCHEMA = 2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class SourceFile:
    """A file that was analysed, and how to tell that it is still the same.

    `path`: empty for data that came from no file. `size`: bytes. `sha256`: of the file; of the arrays where there is none. `reading`:
    options that it was read with.
    """

    path: str = ""
    size: int = 0
    sha256: str = ""
    reading: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_kind("the path of a file", self.path, str)
        check_kind("the hash of a file", self.sha256, str)
        check_kind("options of reading", self.reading, Mapping)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Analysis:
    """The choices of an analysis; what is None or empty is chosen by the program.

    Parameters
    ----------
    schema : int
        Number of the layout.
    version : str
        Of the program that made it.
    files : tuple of SourceFile
    bands : tuple of (float, float)
        Hz.
    exclude : tuple of labels
        Channels left out.
    route : str
        From records with inputs, "auto" by default.
    reciprocal : bool, optional
        Whether inputs and outputs of responses are exchanged by reciprocity; None where the program decides.
    method, domain : str, optional
        The cell of the table.
    orders : tuple of int, optional
    options : mapping
        Further options of the data matrix.
    frequencies : tuple of float, optional
        Hz: nothing but the modes there is reported.
    taken, refused : tuple of float
        Modes taken beside the automatic ones, and automatic ones refused, Hz.
    refine : bool
        Whether the selected modes are refined.
    apart : bool
        Whether setups are identified one by one and their modes merged.
    names : mapping of frequency as text to name
        What the user calls modes.
    remarks : tuple of str
        What the user had to say.

    Raises
    ------
    DataError
        A layout of another version, or choices of the wrong kind.
    """

    schema: int = SCHEMA
    version: str = VERSION
    files: tuple[SourceFile, ...] = ()
    bands: tuple[tuple[float, float], ...] = ()
    exclude: tuple[Any, ...] = ()
    route: str = "auto"
    reciprocal: bool | None = None
    method: str | None = None
    domain: str | None = None
    orders: tuple[int, ...] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    frequencies: tuple[float, ...] | None = None
    taken: tuple[float, ...] = ()
    refused: tuple[float, ...] = ()
    refine: bool = True
    apart: bool = False
    names: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if check_count("schema", self.schema) > SCHEMA:
            raise DataError(
                f"an analysis of layout {self.schema} was given",
                f"this version reads up to {SCHEMA}",
                "Use a later version.",
            )
        check_kind("options of an analysis", self.options, Mapping)
        check_kind("refine", self.refine, bool)
        check_kind("apart", self.apart, bool)
        check_kind("reciprocal", self.reciprocal, (bool, type(None)))
        lists = {name: check_each(name, getattr(self, name), "a list") for name in ("bands", "exclude", "remarks")}
        whole = None if self.orders is None else check_each("orders", self.orders, "whole numbers")
        hertz = {name: getattr(self, name) for name in ("frequencies", "taken", "refused")}
        freeze(
            self,
            bands=tuple(check_band(band) for band in lists["bands"]),
            exclude=tuple(lists["exclude"]),
            orders=None if whole is None else tuple(check_count("an order", n, least=0) for n in whole),
            remarks=tuple(str(text) for text in lists["remarks"]),
            **{
                name: None if each is None else tuple(check_number(name, f) for f in check_each(name, each, "numbers"))
                for name, each in hertz.items()
            },
        )

    @property
    def reading(self) -> dict[str, Any] | list[dict[str, Any]]:
        """Options that the files were read with: of all of them where they are the same, else of each."""
        each = [dict(file.reading) for file in self.files] or [{}]
        return each[0] if all(own == each[0] for own in each) else each

    def choices(self) -> dict[str, Any]:
        """Return what was chosen, by the keywords of `analyze`; without what the program decides."""
        bands = self.bands[0] if len(self.bands) == 1 else self.bands or None
        named = {
            "band": bands,
            "exclude": self.exclude or None,
            "route": None if self.route == "auto" else self.route,
            "method": self.method,
            "domain": self.domain,
            "orders": self.orders,
            "frequencies": self.frequencies,
            "take": self.taken or None,
            "refuse": self.refused or None,
            "refine": None if self.refine else False,
            "apart": self.apart or None,
        }
        return {**{name: value for name, value in named.items() if value is not None}, **self.options}


#: A name belongs to the mode within this part of its frequency.
_MAX_RELATIVE_DISTANCE = 0.005


def named_near(names: Mapping[str, str], frequency: float) -> str:
    """Return the name that was given nearest to a frequency; empty where there is none.

    Examples
    --------
    >>> named_near({"177.05": "first bending", "480": "second"}, 177.2)
    'first bending'
    """
    near = [(abs(float(text) - frequency), name) for text, name in names.items()]
    distance, name = min(near, default=(float("inf"), ""))
    return name if distance <= _MAX_RELATIVE_DISTANCE * frequency else ""
