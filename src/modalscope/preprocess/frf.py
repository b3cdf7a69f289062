"""Frequency responses from records: the excitation decides how segments are cut, the estimator where the noise is taken to be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.threads import one_thread
from modalscope.model.checks import DataError, RealArray, check_choice, check_count, check_kind
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.keywords import named
from modalscope.model.signals import Signals
from modalscope.preprocess.estimators import ESTIMATORS, Estimate, check_inputs, coherence_of, noise_powers, solve
from modalscope.preprocess.excitation import find_excitation, find_period
from modalscope.preprocess.local_models import LOCAL, local_models
from modalscope.preprocess.periodic import synchronous
from modalscope.preprocess.plans import plan_hits, plan_runs, put_zoom, shape_windows, without_offset
from modalscope.preprocess.spectra import CrossSpectra, cross_spectra, silent_lines
from modalscope.preprocess.zoom import ZOOMS

__all__ = ["LEAKING", "estimate_frf"]

#: What `processing` says of an estimate whose lines leak into each other: windows cut through the decays.
LEAKING = "random excitation"


@named()
@one_thread
def estimate_frf(
    signals: Signals,
    *,
    estimator: str = "h1",
    excitation: str = "auto",
    segment: int | None = None,
    overlap: float | None = None,
    window: str | None = None,
    noise: tuple[ArrayLike, ArrayLike] | None = None,
    force_window: float | None = None,
    exponential: float | None = None,
    hits: str | Iterable[int] = "good",
    before: int = 20,
    period: int | None = None,
    settle: int = 1,
    zoom: tuple[float, float] | None = None,
    zoom_lines: int | None = None,
    zoom_by: str = "chirp-z",
    held: bool = False,
    degree: int | None = None,
    half_width: int | None = None,
) -> FrequencyResponse:
    """Frequency responses of all outputs to all inputs, with coherence and variance, from records of any excitation.

    Parameters
    ----------
    signals : Signals
        Outputs and inputs, one run or several; runs are averaged. Their mean is removed (at hits: their median).
    estimator : {"h1", "h2", "hv", "lpm", "lrm"}
        Where the noise is: on the outputs (H1 = S_yu S_uu^-1), on the inputs (H2), or on both (Hv, total least squares).
        Correlated inputs are solved for together. "lpm" and "lrm" fit local polynomials or rational functions to the lines of whole
        runs, without window, average or leakage (`modalscope.preprocess.local_models`); noise is on the outputs.
    excitation : {"auto", "random", "burst", "sweep", "periodic", "impact"}
        What the forces are; by default told from them, periodic ones excepted. Random forces are averaged over overlapping
        segments; runs of bursts and sweeps, which begin and end within the run, are transformed whole; periodic forces are averaged
        over periods; impacts are cut at the hits.
    segment : int, optional
        Samples of a segment. By default an eighth of a run times the number of runs for random forces, and up to a quarter where
        the narrowest resonance needs it; the whole run for bursts and sweeps, up to the next hit for impacts.
    overlap : float, optional
        Part of a segment that the next one shares; for random forces one half with a window, else none.
    window : str, optional
        "hann" (random forces), "flattop", "none" (all others), "hamming", "blackman", "blackmanharris" or "tukey".
    noise : (outputs, inputs), optional
        Relative noise powers for "hv" and "h2", one number or one a channel; only their ratios matter. By default the
        same fraction of every channel's own power.
    force_window : float, optional
        Seconds after a hit's trigger during which the force is kept; zero after that.
    exponential : float, optional
        Value to which an exponential window on outputs and inputs falls at the end of a segment, such as 0.01. Its damping
        is kept as `added_damping`, so that identified poles are shifted back exactly.
    hits : {"good", "all"} or numbers
        Which hits are used: all but overloaded ones, all, or those of these numbers, counted from 1 over all runs.
    before : int
        Samples kept ahead of a hit.
    period : int, optional
        Period of a periodic excitation in samples; found by itself by default.
    settle : int
        Periods left out at the start of a run, until the structure has settled.
    zoom : (f1, f2), optional
        Band in Hz on which alone the lines are computed.
    zoom_lines : int, optional
        Number of lines of the zoom; by default those of the segment's own transform.
    zoom_by : {"chirp-z", "decimation"}
        How the zoom is done.
    held : bool
        Whether the forces were held between samples (simulations, converters without a filter). The response is then that
        of a sampled system and keeps its sampling rate, for the domain "z".
    degree : int, optional
        Of the polynomials of "lpm" and "lrm"; 2 by default.
    half_width : int, optional
        Lines on either side that they are fitted to.

    Returns
    -------
    FrequencyResponse
        With coherence (ordinary for one input, multiple for several), variance of the complex estimates and the number of
        averages; without the first two when there are no more averages than inputs. Lines on which an input has no power,
        such as 0 Hz of a record whose mean was removed, are left out. `processing` says what was done.

    Raises
    ------
    DataError
        No inputs, one without any force, inputs that are multiples of each other, too few averages, options that do not go
        together.

    References
    ----------
    Bendat and Piersol, "Random Data", chapters 7 and 9 (variances); Rocklin, Crowley and Vold, "A comparison of H1, H2 and
    Hv", IMAC 1985.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal((4096, 1))
    >>> record = Signals(outputs=2 * u + 0.1 * rng.standard_normal(u.shape), inputs=u, sampling_rate=100.0)
    >>> frf = estimate_frf(record)
    >>> frf.averages, bool(np.all(np.abs(frf.values - 2) < 0.2))
    (15, True)
    """
    check_kind("estimate_frf", signals, Signals)
    check_choice("estimator", estimator, (*ESTIMATORS, *LOCAL))
    check_choice("zoom_by", zoom_by, ZOOMS)
    _check_forces(signals)
    if estimator in LOCAL:
        averaging = (segment, overlap, window, noise, force_window, exponential, period, zoom)
        return _local(signals, estimator, degree, half_width, excitation, averaging, held)
    kind = find_excitation(signals, excitation)
    _check_options(
        kind, period=period, force_window=force_window, exponential=exponential, zoom=zoom, estimator=estimator
    )
    if kind == "periodic":
        return _periodic(signals, period, check_count("settle", settle, least=0), zoom, held)
    if kind == "impact":
        plan = plan_hits(signals, segment, hits, check_count("before", before, least=0), window)
    else:
        plan = plan_runs(signals, kind, segment, overlap, window)
    shape_windows(plan, force_window, exponential, before)
    if zoom is not None:
        put_zoom(plan, zoom, zoom_lines, zoom_by)
    spectra = cross_spectra(plan.outputs, plan.inputs, plan.sampling_rate, plan.segments, transform=plan.transform)
    spectra = _excited(spectra, plan.notes)
    check_inputs(spectra, signals.input_dofs)
    estimate = solve(spectra, estimator, noise_powers(spectra, estimator, noise))
    averages = f"{spectra.averages} average" + ("s" if spectra.averages > 1 else "")
    note = f"{estimator.upper()} of {averages}, {kind} excitation: {'; '.join(plan.notes)}"
    return _response(
        signals, spectra.frequencies, estimate, coherence_of(spectra), spectra.averages, note, plan.added_damping, held
    )


def _local(
    signals: Signals,
    estimator: str,
    degree: int | None,
    half_width: int | None,
    excitation: str,
    averaging: tuple[object, ...],
    held: bool,
) -> FrequencyResponse:
    kind = find_excitation(signals, excitation)
    if kind in ("periodic", "impact") or any(option is not None for option in averaging):
        raise DataError(
            f"estimator={estimator!r} was asked",
            f"the excitation is {kind}"
            if kind in ("periodic", "impact")
            else "an option of averaged segments was given",
            "Use estimator='h1' for these; local models take whole runs of random forces, sweeps and bursts.",
        )
    found = local_models(signals, estimator, 2 if degree is None else degree, half_width)
    words = {"lpm": "local polynomial", "lrm": "local rational"}[estimator]
    note = f"{words} models on {2 * found.half_width + 1} lines of whole runs, no window, no average"
    estimate = Estimate(found.values, found.variance)
    return replace(_response(signals, found.frequencies, estimate, found.coherence, 1, note, 0.0, held), averages=None)


def _check_forces(signals: Signals) -> None:
    if signals.inputs is None:
        raise DataError(
            "frequency responses were asked",
            "the record has no inputs",
            "Give the forces as inputs, or use estimate_correlation for a record of responses alone.",
        )
    inputs = signals.inputs.reshape(-1, signals.inputs.shape[-1])
    dead = [dof for dof, force in zip(signals.input_dofs, inputs.T, strict=True) if np.all(force == force[0])]
    if dead:
        raise DataError(
            f"frequency responses to {', '.join(signals.input_dofs)} were asked",
            f"{', '.join(dead)} is the same at all samples: there is no force",
            f"Leave it out: select(exclude={dead!r}).",
        )


def _check_options(kind: str, **options: object) -> None:
    wrong = []
    if kind != "periodic" and options["period"] is not None:
        wrong.append(("period", 'excitation="periodic"'))
    if kind != "impact" and options["force_window"] is not None:
        wrong.append(("force_window", 'excitation="impact"'))
    if kind in ("periodic", "random") and options["exponential"] is not None:
        wrong.append(("exponential", 'excitation="impact", "burst" or "sweep"'))
    if kind == "periodic" and options["estimator"] != "h1":
        wrong.append(
            (
                f"estimator={options['estimator']!r}",
                'estimator="h1": averaging over periods removes noise on both sides',
            )
        )
    if wrong:
        name, needed = wrong[0]
        raise DataError(f"{name} was asked", f"the excitation is {kind}", f"Leave it out, or give {needed}.")


def _excited(spectra: CrossSpectra, notes: list[str]) -> CrossSpectra:
    """Leave out the lines on which an input has no power at all."""
    silent = silent_lines(spectra)
    count = int(np.sum(silent))
    if count == 0:
        return spectra
    where = "0 Hz" if count == 1 and silent[0] and spectra.frequencies[0] == 0 else f"{count} lines"
    notes.append(f"{where} left out, without force")
    return spectra.at_lines(~silent)


def _periodic(
    signals: Signals, period: int | None, settle: int, zoom: tuple[float, float] | None, held: bool
) -> FrequencyResponse:
    if zoom is not None:
        raise DataError(
            "a zoom with periodic excitation was asked",
            "its lines are those of the period, between them there is no force",
            "Leave zoom out, and cut the result with band().",
        )
    outputs, inputs = without_offset(signals, "periodic")
    length = find_period(inputs, period)
    result = synchronous(outputs, inputs, signals.sampling_rate, length, settle, signals.input_dofs)
    note = (
        f"synchronous average of {result.periods} periods of {length} samples in {signals.runs} "
        f"run{'s' if signals.runs > 1 else ''}, no window, mean removed; {result.silent} lines left out, without force"
    )
    return _response(
        signals, result.frequencies, result.estimate, result.coherence, result.periods * signals.runs, note, 0.0, held
    )


def _response(
    signals: Signals,
    frequencies: RealArray,
    estimate: Estimate,
    coherence: RealArray | None,
    averages: int,
    note: str,
    added_damping: float,
    held: bool,
) -> FrequencyResponse:
    return FrequencyResponse(
        values=estimate.values,
        frequencies=frequencies,
        quantity=signals.quantity,
        sampling_rate=signals.sampling_rate if held else None,
        coherence=coherence,
        variance=estimate.variance,
        averages=averages,
        added_damping=added_damping,
        output_dofs=signals.output_dofs,
        input_dofs=signals.input_dofs,
        units=signals.units,
        geometry=signals.geometry,
        processing=(*signals.processing, note),
    )
