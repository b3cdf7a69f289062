"""Estimate frequency responses from records: the excitation sets how segments are cut, the estimator where the noise is assumed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import figures
from modalscope.numerics.arguments import at_least, named
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread
from modalscope.signals.preprocess.estimators import (
    ESTIMATORS,
    Estimate,
    check_inputs,
    coherence_of,
    noise_powers,
    solve,
    synchronous,
)
from modalscope.signals.preprocess.excitation import driven_records, find_excitation, find_period
from modalscope.signals.preprocess.local_polynomials import LOCAL, local_models
from modalscope.signals.preprocess.plans import Plan, apply_windows, plan_hits, plan_runs, without_offset, zoom_plan
from modalscope.signals.preprocess.spectra import cross_spectra, silent_lines

#: Minimum lines in a half bandwidth: the leakage of a Hann window then is below a few per cent of the damping.
_LINES_A_HALF_BANDWIDTH = 4.0

#: Mark in `processing` of an estimate with leakage: windows cut through the decays.
LEAKING = "random excitation"


@named(signals=Signals, estimator=(*ESTIMATORS, *LOCAL), before=at_least(0), settle=at_least(0))
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
    held: bool = False,
    degree: int | None = None,
    half_width: int | None = None,
) -> FrequencyResponse:
    """Estimate frequency responses of all outputs to all inputs, with coherence and variance, from records of any excitation.

    Parameters
    ----------
    signals : Signals
        Outputs and inputs, one run or several; runs are averaged. Their mean is removed (at hits: their median).
    estimator : {"h1", "h2", "hv", "lpm", "lrm"}
        Where the noise is: on the outputs (H1 = S_yu S_uu^-1), on the inputs (H2), or on both (Hv, total least squares).
        Correlated inputs are solved for together. "lpm" and "lrm" fit local polynomials or rational functions to the lines of whole
        runs, without window, average or leakage (`modalscope.signals.preprocess.local_polynomials`); noise is on the outputs.
    excitation : {"auto", "random", "burst", "sweep", "periodic", "impact"}
        Kind of the forces; by default detected, except for periodic ones. Random forces are averaged over overlapping
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
        Relative noise powers for "hv" and "h2", one number or one per channel; only their ratios matter. By default the
        same fraction of every channel's own power.
    force_window : float, optional
        Seconds after a hit's trigger during which the force is kept; zero after that. By default, of several hits, zero where nothing
        stands out of its noise, if that explains more of the outputs.
    exponential : float, optional
        Value to which an exponential window on outputs and inputs falls at the end of a segment, such as 0.01. Its damping
        is kept as `added_damping`, so that identified poles are shifted back exactly.
    hits : {"good", "all"} or numbers
        Which hits are used: all but overloaded ones, all, or those of these numbers, counted from 1 over all runs.
    before : int
        Samples kept ahead of a hit.
    period : int, optional
        Period of a periodic excitation in samples; detected by default.
    settle : int
        Periods excluded at the start of a run, until the vibration is stationary.
    zoom : (f1, f2), optional
        Band in Hz on which alone the lines are computed.
    zoom_lines : int, optional
        Number of lines of the zoom; by default those of the segment's own transform.
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
        such as 0 Hz of a record whose mean was removed, are excluded. `processing` lists the steps.

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
    _check_forces(signals)
    kind = find_excitation(signals, excitation)
    if estimator in LOCAL:
        averaging = (segment, overlap, window, noise, force_window, exponential, period, zoom)
        averaged = any(option is not None for option in averaging)
        result = _local(signals, estimator, degree, half_width, kind, averaged)
    elif kind == "periodic":
        _check_options(kind, estimator, period, force_window, exponential)
        result = _periodic(signals, period, settle, zoom)
    else:
        _check_options(kind, estimator, period, force_window, exponential)
        if kind == "impact":
            plan = plan_hits(signals, segment, hits, before, window, as_told=force_window is not None)
        else:
            plan = plan_runs(signals, kind, segment, overlap, window)
        apply_windows(plan, force_window, exponential, before)
        if zoom is not None:
            zoom_plan(plan, zoom, zoom_lines)
        result = _averaged(plan, signals.input_dofs, kind, estimator, noise)
    return FrequencyResponse(
        values=result.estimate.values,
        frequencies=result.frequencies,
        quantity=signals.quantity,
        sampling_rate=signals.sampling_rate if held else None,
        coherence=result.coherence,
        variance=result.estimate.variance,
        averages=result.averages,
        added_damping=result.added_damping,
        **signals.processed(result.note).labelled(),
    )


class _Result(NamedTuple):
    """Estimates on lines (Hz), and what `processing` notes of them."""

    frequencies: RealArray
    estimate: Estimate
    coherence: RealArray | None
    averages: int | None
    note: str
    added_damping: float = 0.0


def _averaged(
    plan: Plan, inputs: tuple[str, ...], kind: str, estimator: str, noise: tuple[ArrayLike, ArrayLike] | None
) -> _Result:
    """Estimate from averaged spectra, without the lines on which an input has no power."""
    spectra = cross_spectra(plan.outputs, plan.inputs, plan.sampling_rate, plan.segments, transform=plan.transform)
    silent = silent_lines(spectra)
    if count := int(np.sum(silent)):
        excluded = "0 Hz" if count == 1 and silent[0] and spectra.frequencies[0] == 0 else f"{count} lines"
        plan.notes.append(f"{excluded} left out, without force")
        spectra = spectra.at_lines(~silent)
    check_inputs(spectra, inputs)
    estimate = solve(spectra, estimator, noise_powers(spectra, estimator, noise))
    averages = f"{spectra.averages} average" + ("s" if spectra.averages > 1 else "")
    note = f"{estimator.upper()} of {averages}, {kind} excitation: {'; '.join(plan.notes)}"
    return _Result(spectra.frequencies, estimate, coherence_of(spectra), spectra.averages, note, plan.added_damping)


def _local(
    signals: Signals, estimator: str, degree: int | None, half_width: int | None, kind: str, averaged: bool
) -> _Result:
    """Estimate by local models; DataError where the excitation or an option asks for averages."""
    cut = kind in ("periodic", "impact")
    if cut or averaged:
        have = f"the excitation is {kind}" if cut else "an option of averaged segments was given"
        change = "Use estimator='h1' there; local models need whole runs of random forces, sweeps or bursts."
        raise DataError(f"estimator={estimator!r}:", have, change)
    local = local_models(signals, estimator, 2 if degree is None else degree, half_width)
    model = {"lpm": "local polynomial", "lrm": "local rational"}[estimator]
    note = f"{model} models on {2 * local.half_width + 1} lines of whole runs, no window, no average"
    return _Result(local.frequencies, Estimate(local.values, local.variance), local.coherence, None, note)


def _check_forces(signals: Signals) -> None:
    inputs = np.concatenate(driven_records(signals, "frequency responses")[1])
    dead = [dof for dof, force in zip(signals.input_dofs, inputs.T, strict=True) if np.all(force == force[0])]
    if dead:
        asked, have = f"responses to {', '.join(signals.input_dofs)}:", f"{', '.join(dead)} is constant: no force"
        raise DataError(asked, have, f"Leave it out: select(exclude={dead!r}).")


def _check_options(
    kind: str, estimator: str, period: int | None, force_window: float | None, exponential: float | None
) -> None:
    options = (
        ("period", period, ("periodic",)),
        ("force_window", force_window, ("impact",)),
        ("exponential", exponential, ("impact", "burst", "sweep")),
    )
    have = f"the excitation is {kind}"
    for name, value, kinds in options:
        if value is not None and kind not in kinds:
            needed = " or ".join(map(repr, kinds))
            raise DataError(f"{name}:", have, f"Leave it out, or give excitation={needed}.")
    if kind == "periodic" and estimator != "h1":
        change = "Give estimator='h1': averaging over periods removes noise on both sides."
        raise DataError(f"estimator={estimator!r}:", have, change)


def _periodic(signals: Signals, period: int | None, settle: int, zoom: tuple[float, float] | None) -> _Result:
    """Estimate by the synchronous average over periods."""
    if zoom is not None:
        have, change = "its lines are those of the period", "Leave zoom out, and cut the result with band()."
        raise DataError("a periodic excitation allows no zoom", have, change)
    outputs, inputs = without_offset(signals, "periodic")
    length = find_period(inputs, period)
    mean = synchronous(outputs, inputs, signals.sampling_rate, length, settle, signals.input_dofs)
    runs = f"{signals.runs} run{'s' if signals.runs > 1 else ''}"
    average = f"synchronous average of {mean.periods} periods of {length} samples in {runs}"
    note = f"{average}, no window, mean removed; {mean.silent} lines left out, without force"
    return _Result(mean.frequencies, mean.estimate, mean.coherence, mean.periods * signals.runs, note)


def leakage_note(data: Any, response: Response, frequencies: Array, damping_ratios: Array) -> Note | None:
    """Return a warning where the half bandwidth zeta f of a mode is less than four times 1/T; None where all are wide enough.

    A window of T seconds widens a resonance by about 1/T, so that averaged segments of records under random forces overestimate the
    damping. Records whose vibration begins and ends within a run do not leak. Frequencies are in Hz.
    """
    runs = getattr(data, "recordings", ())
    random = runs and all(run.inputs is not None and find_excitation(run) == "random" for run in runs)
    if not (isinstance(response, FrequencyResponse) and response.averages and response.lines > 1 and random):
        return None
    spacing = float(np.min(np.diff(response.frequencies)))
    half = np.asarray(damping_ratios) * np.asarray(frequencies)
    narrow = np.flatnonzero((half > 0) & (half < _LINES_A_HALF_BANDWIDTH * spacing))
    if not narrow.size:
        return None
    worst = narrow[np.argmin(half[narrow])]
    f, width = float(frequencies[worst]), float(half[worst])
    text = (
        f"Leakage makes the damping of {narrow.size} of {half.size} modes too high: their half bandwidth (at least {figures(width)} Hz, at "
        f"{f:.4g} Hz) is below four line spacings of {figures(spacing)} Hz. Use route='records', estimator='lrm', or segments of "
        f"{figures(_LINES_A_HALF_BANDWIDTH / width)} s"
    )
    return Note("leakage", {"modes": narrow.size, "spacing": spacing, "frequency": f, "half_bandwidth": width}, text)
