"""Hold the result of an analysis: modes, stabilization diagrams, settings and notes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data.analysis import Analysis
from modalscope.data.deferred import Column, Deferred
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note, notes_of
from modalscope.data.response import Response
from modalscope.data.shown import Shown, said_of
from modalscope.data.whitening import Whitening
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, freeze, locked, stays_locked
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import HasPoles
from modalscope.numerics.handed import handed


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Settings:
    """Options by name; those at their default None are left out, so that `identify(data, **settings)` repeats what was done.

    `band`: lowest and highest frequency in Hz that is used. `exclude`: channels left out. `route`: from records with inputs: "records",
    "frf", "markov", "subspace" or "decays". `delays`: of those: samples by which outputs come late after the forces, which was taken
    out; {} for none. `reciprocal`: True where inputs and outputs were exchanged by reciprocity, False where that was refused.
    `factorization`: the route to the singular vectors.
    """

    band: tuple[float, float] | None = None
    exclude: tuple[Any, ...] | None = None
    route: str | None = None
    delays: Mapping[str, int] | None = None
    reciprocal: bool | None = None
    factorization: str = "auto"

    def keys(self) -> Iterator[str]:
        """Return the names of the options that have a value."""
        return (f.name for f in fields(self) if getattr(self, f.name) is not None)

    def __iter__(self) -> Iterator[str]:
        return self.keys()

    def __getitem__(self, name: str) -> Any:
        if name not in self.keys():
            raise KeyError(name)
        return getattr(self, name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return an option, or a default where it is not set."""
        value = getattr(self, name, None)
        return default if value is None else value

    def items(self) -> list[tuple[str, Any]]:
        """Return names and values of the options that are set."""
        return [(name, getattr(self, name)) for name in self.keys()]


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class StabilizationDiagram(Shown, HasPoles):
    """Poles of all orders, flat, with what is stable against the order before.

    Parameters
    ----------
    response : ImpulseResponse or FrequencyResponse
        The data that were identified, cut to the band.
    method, domain : str
        The row and the column of the table of methods.
    orders : tuple of int
        The orders that were reached, increasing.
    order_of_pole : array of int, (p,)
        The order that each pole belongs to.
    poles : array of complex, (p,)
        rad/s; one of each conjugate pair, and real ones.
    shapes : array of complex, (l, p)
    participation : array of complex, (p, m)
    stable_frequency, stable_damping, stable_shape : array of bool, (p,)
        Whether a pole of the order before agrees within the tolerances.
    frequencies_std, damping_ratios_std : array, (p,), optional
        Standard deviations from the noise, Hz and ratio; NaN where they are withheld, None where they were not asked. They are computed
        when they are first read.
    indicators : mapping of name to array (p,)
    singular_values : array, (k,)
        Of the data matrix that all orders were cut from.
    fit_errors : array, (number of orders,)
        norm(measured - rebuilt) / norm(measured) of every order, each output divided by its root mean square.
    exact_rank : int, optional
        The rank of data without noise; orders above it are left out.
    asked_orders : tuple of int
        The orders that were asked, with those out of reach: sizes that were not given followed from the largest.
    tolerances : mapping
        The limits of stability: frequency and damping (relative), shape (1 - MAC).
    settings : mapping
        Block sizes and options that were used.
    notes : tuple of Note
        What was left out, and why.
    dt : float or None
        Sampling interval of the identified system.
    measured : FrequencyResponse, optional
        The lines that the samples of `response` were made of; None where it was not transformed.
    outside, order_of_outside : array of complex and of int, (q,), optional
        Poles outside the band, rad/s, and the order that each belongs to: the data in the band need them all the same.
    output_whitening, reference_whitening : array, (l, l) and (m, m) or their diagonals, optional
        W and V of ambient channels, and levels of other responses: poles were found, and fit errors are those, in W R V', and modes are
        selected there; shapes, participation and `response` are those of the channels.
    """

    response: Response
    method: str
    domain: str
    orders: tuple[int, ...]
    order_of_pole: IntArray
    poles: ComplexArray
    shapes: ComplexArray
    participation: ComplexArray
    stable_frequency: Array
    stable_damping: Array
    stable_shape: Array
    frequencies_std: RealArray | None = None
    damping_ratios_std: RealArray | None = None
    indicators: Mapping[str, RealArray] = field(default_factory=dict)
    singular_values: RealArray
    fit_errors: RealArray
    exact_rank: int | None = None
    asked_orders: tuple[int, ...] = ()
    tolerances: Mapping[str, float] = field(default_factory=dict)
    settings: Settings = field(default_factory=Settings)
    notes: tuple[Note, ...] = ()
    dt: float | None = None
    measured: Response | None = None
    outside: ComplexArray = field(default_factory=lambda: np.zeros(0, complex))
    order_of_outside: IntArray = field(default_factory=lambda: np.zeros(0, int))
    output_whitening: RealArray | None = None
    reference_whitening: RealArray | None = None

    def __post_init__(self) -> None:
        flat = ["order_of_pole", "poles", "shapes", "participation"]
        flat += ["stable_frequency", "stable_damping", "stable_shape"]
        flat += [n for n, value in self._unread().items() if value is not None and not isinstance(value, Deferred)]
        needed = dict.fromkeys(flat, np.shape(self.poles)[0]) | {"order_of_outside": np.shape(self.outside)[0]}
        for name, count in needed.items():
            array = np.asarray(getattr(self, name))
            there = array.shape[-1 if name == "shapes" else 0]
            if there != count:
                raise DataError(f"a diagram of {count} poles needs as many {name}", f"there are {there}", "Give all.")
            freeze(self, **{name: locked(array)})
        freeze(
            self,
            outside=locked(np.asarray(self.outside)),
            notes=notes_of(self.notes),
            output_whitening=None if self.output_whitening is None else locked(self.output_whitening),
            reference_whitening=None if self.reference_whitening is None else locked(self.reference_whitening),
            indicators={k: locked(np.asarray(v)) for k, v in self.indicators.items()},
            fit_errors=locked(np.asarray(self.fit_errors)),
            singular_values=locked(np.asarray(self.singular_values)),
        )

    @property
    def whitening(self) -> Whitening | None:
        """What whitens the channels; None where they were taken as they are."""
        if self.output_whitening is None or self.reference_whitening is None:
            return None
        return Whitening(self.output_whitening, self.reference_whitening)

    def poles_at(self, order: int) -> ComplexArray:
        """Return the poles of one order with those outside the band; none where no order is `order`.

        Parameters
        ----------
        order : int
            One of `orders`.

        Returns
        -------
        ndarray, (number of poles,)
            rad/s, those in the band first.
        """
        return np.concatenate([self.poles[self.order_of_pole == order], self.outside[self.order_of_outside == order]])

    def whitened(self) -> StabilizationDiagram:
        """Return the diagram of the whitened channels, in which modes are selected; itself where there are none."""
        whitening = self.whitening
        if whitening is None:
            return self
        return self.changed(
            response=whitening.of_response(self.response),
            measured=None if self.measured is None else whitening.of_response(self.measured),
            shapes=whitening.of_shapes(self.shapes),
            participation=whitening.of_participation(self.participation),
            output_whitening=None,
            reference_whitening=None,
        )

    def to_xarray(self) -> Any:
        """Return an xarray Dataset of all poles: order, frequency, damping ratio, what is stable, deviations, indicators, shapes.

        Raises
        ------
        DataError
            xarray is missing: the extra `netcdf` brings it.
        """
        return import_module("modalscope.data.named_axes").dataset(self)

    def _unread(self) -> dict[str, Any]:
        """Return the standard deviations as they are held, without computing them."""
        return {name: getattr(type(self), name).unread(self) for name in DEVIATIONS}

    def changed(self, **fields: Any) -> StabilizationDiagram:
        """Return the diagram with some fields changed; standard deviations that were not read stay so, as they do not in `replace`.

        Parameters
        ----------
        **fields
            As in `StabilizationDiagram`.
        """
        return replace(self, **{**self._unread(), **fields})

    def deviations_at(self, index: Array, *, known: bool = False) -> tuple[RealArray | None, RealArray | None]:
        """Return the standard deviations of frequency (Hz) and damping ratio of some poles, and compute no others.

        Parameters
        ----------
        index : array of int
            Which poles.
        known : bool
            Compute none: NaN for those that were not read.
        """
        some = np.asarray(index)
        frequency, damping = (getattr(type(self), name).at(self, some, known=known) for name in DEVIATIONS)
        return frequency, damping

    @property
    def as_measured(self) -> Response:
        """The data before they were transformed for the row: what they say against noise is asked there.

        Samples that were made of lines have the errors of these, spread over all of them: where the band ends at nothing they are
        correlated, and what lies outside the band is missing from every sample, where it has no form that a fit could carry.
        """
        return self.response if self.measured is None else self.measured

    @property
    def stable(self) -> Array:
        """True where frequency, damping and shape all agree with the order before."""
        return self.stable_frequency & self.stable_damping & self.stable_shape


#: Fields of a diagram that are computed when they are first read.
DEVIATIONS = ("frequencies_std", "damping_ratios_std")

for _column, _name in enumerate(DEVIATIONS):
    setattr(StabilizationDiagram, _name, Column(getattr(StabilizationDiagram, _name), _column))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Result(Shown):
    """What `analyze` gives.

    Parameters
    ----------
    modes : ModalModel
        With the reasons of each.
    diagrams : tuple of StabilizationDiagram
        One per band; none in a result that was read from a file.
    findings : tuple of Finding
        What an examination of the data saw.
    notes : tuple of Note
        What was chosen, converted and left out, and what to be careful about.
    analysis : Analysis
        The choices: `modalscope.replay(result.analysis)` gives the same result again.
    data : object, optional
        What was analysed; None in a result that was read from a file.
    """

    modes: ModalModel
    diagrams: tuple[StabilizationDiagram, ...] = ()
    findings: tuple[Any, ...] = ()
    notes: tuple[Note, ...] = ()
    analysis: Analysis
    data: Any = None

    def __post_init__(self) -> None:
        freeze(self, notes=notes_of(self.notes), diagrams=tuple(self.diagrams), findings=tuple(self.findings))

    @property
    def diagram(self) -> StabilizationDiagram:
        """The stabilization diagram; of several bands the first."""
        if not self.diagrams:
            raise DataError("the diagram:", "a file holds none", "Make it again: modalscope.replay(result.analysis).")
        return self.diagrams[0]

    def __str__(self) -> str:
        said = said_of(self)
        return "\n".join([self.modes.table() if len(self.modes) else "no mode", *(["", *said] if said else [])])

    def save(self, path: str | Path, **options: Any) -> Path:
        """Write the modes, in .json with the document of the analysis, or a report: the format by suffix, as `write` and `report` do.

        Parameters
        ----------
        path : path
            Such as `modes.json`, `modes.csv`, `modes.uff` or `modes.xlsx`; a report `modes.html`, `modes.docx` or `modes.pptx`.
        **options
            As of `modalscope.write` or `modalscope.report`.
        """
        verb = "report" if str(path).lower().endswith((".html", ".docx", ".pptx")) else "write"
        handed(verb)(thing=self, path=path, **options)
        return Path(path)

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Return the table for a notebook, and the living diagram where anywidget is installed and the front end is built."""
        bundle = {"text/plain": repr(self), "text/html": self._repr_html_()}
        if not self.diagrams or not len(self.modes) or find_spec("anywidget") is None:
            return bundle
        return {**bundle, **handed("living")(self), "text/html": bundle["text/html"]}

    @property
    def settings(self) -> tuple[Settings, ...]:
        """Every option with the value that was taken, one per band."""
        return tuple(diagram.settings for diagram in self.diagrams)
