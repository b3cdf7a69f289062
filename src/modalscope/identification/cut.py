"""One order of a sweep: its model, its modes, and how far to trust them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modalscope.blocks.misfit import Misfit
from modalscope.blocks.triple import Triple
from modalscope.identification.pipeline import Pipeline
from modalscope.modal.accuracy import indicators_of_all
from modalscope.modal.eigenmodes import Eigenmodes, eigenmodes, split_extraneous
from modalscope.modal.rebuilt import modal_model
from modalscope.model.checks import ComplexArray, DataError, IntArray, RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.output_levels import output_scale
from modalscope.model.poles import frequencies_and_damping
from modalscope.uncertainty.deviations import Asked, Deviations, deviations_of
from modalscope.uncertainty.noise import Noise, noise_of
from modalscope.uncertainty.residual import residual_variance, unexplained_energy

__all__ = ["Cut", "Shared", "cut_order", "judged"]

#: Orders are judged together while their states times lines or samples are no more than this: arrays in between stay in the cache.
_TOGETHER = 100_000

#: Poles are the same to this part of them: deviations are told to three digits.
_SAME = 1e-8


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """One order: its model, its modes and how far to trust them.

    Parameters
    ----------
    order : int
    triple : Triple
        (A, B, C), with inputs and outputs in their own places.
    modal : Eigenmodes
        All its poles, as they are in the data.
    wrapped : callable
        () -> the same, with what an exponential window added taken off.
    reported : array of int
        The poles that a rank explains and that lie in the band.
    indicators : mapping of name to array (k,)
    misfit : float
        norm(measured - rebuilt) / norm(measured) over the data, each output divided by its root mean square.
    std : Deviations, optional
        Standard deviations of the reported poles, where they were asked.
    """

    order: int
    triple: Triple
    modal: Eigenmodes
    wrapped: Callable[[], ModalModel]
    reported: IntArray
    indicators: Mapping[str, RealArray]
    misfit: float
    std: Deviations | None = None

    @cached_property
    def modes(self) -> ModalModel:
        """All its poles with what an exponential window added taken off, made when they are first asked for."""
        modes = self.wrapped()
        if self.std is None:
            return modes
        return replace(modes, frequencies_std=self.std.frequency, damping_ratios_std=self.std.damping_ratio)


def cut_order(pipeline: Pipeline, order: int, *, deviations: bool = True) -> Cut:
    """Cut one order out of a pipeline and judge it.

    Parameters
    ----------
    pipeline : Pipeline
    order : int
    deviations : bool
        Whether standard deviations are wanted.
    """
    return Shared(pipeline, deviations).of_order(order)


def judged(pipeline: Pipeline, orders: Sequence[int], measured: Shared) -> list[Cut | DataError]:
    """Return the first of some orders, or why there is none: as many of them as are better judged together, at least one.

    Parameters
    ----------
    pipeline : Pipeline
    orders : sequence of int
        Increasing, at least one.
    measured : Shared
    """
    found: list[tuple[int, Triple, Eigenmodes] | DataError] = []
    size = 0
    for order in orders:
        try:
            model = pipeline.triple(order)
            found.append((order, model, _checked(pipeline, eigenmodes(pipeline.matrix, model))))
        except DataError as error:
            found.append(error)
            continue
        size += len(model.A) * pipeline.response.count
        if size > _TOGETHER or not (pipeline.matrix.fitted.by_mode and model.span is None):
            break
    good = [part for part in found if not isinstance(part, DataError)]
    modes = measured.with_bases([modal for _, _, modal in good])
    cuts = iter(measured.cuts([(order, model, modal) for (order, model, _), modal in zip(good, modes, strict=True)]))
    return [part if isinstance(part, DataError) else next(cuts) for part in found]


def _checked(pipeline: Pipeline, modal: Eigenmodes) -> Eigenmodes:
    """Return modes that are numbers; what is wrong with others the making of their model says."""
    if not all(np.all(np.isfinite(values)) for values in (modal.poles, modal.shapes, modal.participation)):
        modal_model(pipeline.matrix, modal, {})
    return modal


class _Told(NamedTuple):
    """What is known of the poles of an order, some of which were asked."""

    poles: ComplexArray
    asked: IntArray
    deviations: Deviations

    def of(self, poles: ComplexArray, asked: IntArray) -> bool:
        """Whether these are the same poles, in the same order, and the same ones are asked."""
        if self.poles.shape != poles.shape or not np.array_equal(self.asked, asked):
            return False
        return bool(np.all(np.abs(self.poles - poles) <= _SAME * np.abs(poles)))


class Shared:
    """The data that every order is fitted to and the noise in them: what all orders share, computed once.

    Parameters
    ----------
    pipeline : Pipeline
    deviations : bool
        Whether standard deviations are wanted.
    """

    def __init__(self, pipeline: Pipeline, deviations: bool) -> None:
        self._pipeline, self._matrix = pipeline, pipeline.matrix.fitted
        self._response = self._matrix.judged
        self._misfit = Misfit(pipeline.response, output_scale(pipeline.response))
        self._complex = bool(np.iscomplexobj(self._response.values))
        self._weighted = getattr(self._matrix, "weights", None) is not None
        self.noise = noise_of(self._response, pipeline.problem.records) if deviations else None
        self._told: dict[int, _Told] = {}

    def cuts(self, parts: Sequence[tuple[int, Triple, Eigenmodes]]) -> list[Cut]:
        """Return orders with their indicators, and the standard deviations of their poles, where they are wanted.

        Parameters
        ----------
        parts : sequence of (int, Triple, Eigenmodes)
            Of one order, or of several that are judged together.
        """
        if not parts:
            return []
        indicators = indicators_of_all(self._pipeline.matrix, [part[1:] for part in parts])
        reported = [self._reported(model, modal) for _, model, modal in parts]
        std = self._deviations(parts, reported)
        return [self._cut(*each) for each in zip(parts, reported, indicators, std, strict=True)]

    def _deviations(
        self, parts: Sequence[tuple[int, Triple, Eigenmodes]], reported: Sequence[IntArray]
    ) -> list[Deviations | None]:
        """Return the standard deviations of some poles of every order, those that are known as they are; None where none were wanted."""
        if self.noise is None:
            return [None] * len(parts)
        asked = []
        for part, which in zip(parts, reported, strict=True):
            order, _, modal = part
            known = self._told.get(order)
            if known is None or not known.of(modal.poles, which):
                noise = self.noise_beside(modal)
                assert noise is not None
                asked.append(Asked(*part, which, noise))
        for one, found in zip(asked, deviations_of(self._matrix, self._pipeline.realization, *asked), strict=True):
            self._told[one.order] = _Told(one.modal.poles, one.which, found)
        return [self._told[order].deviations for order, _, _ in parts]

    def take_deviations_of(self, other: Shared) -> None:
        """Take the deviations that are known of the same poles: they follow from the poles and the data alone.

        Parameters
        ----------
        other : Shared
        """
        self._told.update(other._told)

    def _reported(self, model: Triple, modal: Eigenmodes) -> IntArray:
        """Return the poles that a rank explains and that lie in the band."""
        kept, _ = split_extraneous(modal, model)
        f, _ = frequencies_and_damping(modal.poles)
        low, high = self._pipeline.reported_band
        return np.asarray(kept[(f[kept] >= low) & (f[kept] <= high)])

    def _cut(
        self,
        part: tuple[int, Triple, Eigenmodes],
        reported: IntArray,
        indicators: Mapping[str, RealArray],
        std: Deviations | None,
    ) -> Cut:
        order, model, modal = part
        bare = replace(modal, fit=replace(modal.fit, basis=None))  # every order's columns together would be large
        return Cut(
            order=order,
            triple=model,
            modal=bare,
            wrapped=partial(modal_model, self._pipeline.matrix, bare, indicators),
            reported=reported,
            indicators=indicators,
            misfit=self.misfit(modal),
            std=std,
        )

    def of_order(self, order: int) -> Cut:
        """Return one order.

        Parameters
        ----------
        order : int

        Raises
        ------
        DataError
            An order that cannot be given.
        """
        (found,) = judged(self._pipeline, [order], self)
        if isinstance(found, DataError):
            raise found
        return found

    def with_bases(self, several: Sequence[Eigenmodes]) -> list[Eigenmodes]:
        """Return modes with what their poles can contribute, made once for all, where the misfit is not known by the fit.

        Parameters
        ----------
        several : sequence of Eigenmodes
            Of one order or of several.
        """
        if self._weighted or self._response is not self._pipeline.response:
            return list(several)
        if not several or any(modes.fit.misfit is not None or modes.fit.basis is not None for modes in several):
            return list(several)
        basis = self._response.basis(np.concatenate([modes.poles for modes in several]), several[0].fit.powers)
        ends = 2 * np.cumsum([0, *(modes.poles.size for modes in several)])
        each = (replace(basis, functions=basis.functions[:, a:b]) for a, b in pairwise(ends))
        own = each if len(several) > 1 else [basis]  # inputs and ends may stand beside the poles
        return [replace(m, fit=replace(m.fit, basis=part)) for m, part in zip(several, own, strict=True)]

    def misfit(self, modes: Eigenmodes) -> float:
        """Return the norm of what modes leave of the level data over that of the data: from the fit where it knows, else rebuilt."""
        return self._misfit.of_fit(modes.poles, modes.fit) if modes.fit.misfit is None else modes.fit.misfit

    def noise_beside(self, modal: Eigenmodes) -> Noise | None:
        """Return the noise, given what no residues at the poles of a model explain, whatever its own shapes leave."""
        if self.noise is None or not self.noise.of_residual:
            return self.noise
        fit, rows = modal.fit, self._response.count * (1 + self._complex)  # of compressed ones there are fewer
        if fit.unexplained is not None and np.all(np.isfinite(fit.unexplained)):
            unknown = len(fit.terms) + 2 * modal.poles.size
            return self.noise.beside(residual_variance(fit.unexplained, rows - unknown, self._complex))
        own = None if self._weighted else fit.basis
        basis = own or self._response.basis(modal.poles, fit.powers)
        unknown = basis.terms.shape[1] + basis.functions.shape[1]
        return self.noise.beside(residual_variance(unexplained_energy(basis), rows - unknown, self._complex))
