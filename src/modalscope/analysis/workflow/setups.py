"""Merge the modes of several setups: average poles, and scale parts of shapes to each other by common outputs (PoSER)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.analysis.workflow.shapes import free_residues
from modalscope.data.channels import AUTO, Groups, check_groups, source_of
from modalscope.data.geometry import indices_of
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Candidate, Note
from modalscope.data.response import Response
from modalscope.data.sameness import likeliest, log_ratios
from modalscope.data.setups import common_outputs
from modalscope.numerics.arguments import POSITIVE, named
from modalscope.numerics.checks import ComplexArray, RealArray, check_each, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.covariance import LEAST_GROUPS, degrees_of_wider, deviations_between
from modalscope.selection.likelihood.noise import undenied


def with_repeatability(modes: ModalModel, response: Response) -> ModalModel:
    """Return modes with the deviation of the mean over the groups of the response's inputs, s / sqrt(G); as they are without four groups.

    `modes`: identified from all groups together. `response`: with `groups`: one label per input.
    """
    between = deviations_between(modes.poles, response)
    if between is None:
        return modes
    # of correlations that were merged no noise is known: then the groups alone tell
    own = [None if x is None or np.isnan(x).all() else x for x in (modes.frequencies_std, modes.damping_ratios_std)]
    stated = np.array([np.zeros(len(modes)) if each is None else np.nan_to_num(each) for each in own])
    free = np.full(stated.shape, np.inf) if modes.degrees is None else modes.degrees.T
    found = replace(
        modes,
        frequencies_std=own[0],
        damping_ratios_std=own[1],
        frequencies_repeatability=between[0],
        damping_ratios_repeatability=between[1],
        degrees=degrees_of_wider(stated, free, between, len(set(response.groups or ()))).T,
    )
    return replace(found, notes=undenied(found, found.notes))


#: Rounds in which shapes and the scales of their parts are fitted alternately.
_MAX_ROUNDS = 10

#: Information on the scales of parts below this part of the largest is rounding: nothing tells the size of all of them.
_ROUNDING = 1e-9

#: Numbers that have deviations.
_NAMES = ("frequencies", "damping_ratios")

#: One mode: its index in every setup that has it.
_Mode = dict[int, int]


@named(tolerance=POSITIVE)
def merge_modes(
    results: Sequence[ModalModel],
    *,
    responses: Sequence[Response] | None = None,
    tolerance: float = 0.03,
    groups: Groups = AUTO,
) -> ModalModel:
    """Put together the modes of setups that share some outputs and were identified one by one (PoSER).

    A mode that more than half of the setups have is reported: f and zeta are the means of its setups, weighted by their variances where all
    are known. Its shape minimizes sum_j |a_j x_j - phi_j|^2 over the scales a_j of the parts x_j, phi_j being the outputs of setup j. The
    deviation between setups is s / sqrt(J), s that of J setups.

    Parameters
    ----------
    results : sequence of ModalModel
        One per setup. Shapes are carried over by the outputs that all have.
    responses : sequence of FrequencyResponse or ImpulseResponse, optional
        What each was measured as: the parts of the shapes are then fitted to these by least squares with the poles of all modes, also
        where a setup lacks a mode. Without them the frequencies of the results are used, without the modes that a setup lacks.
    tolerance : float
        Largest relative distance of frequencies of one mode.
    groups : sequence of labels, "auto" or None
        One label per setup; by default every setup is a group. Fewer than four say nothing of repeatability.

    Returns
    -------
    ModalModel
        Of all outputs; `reasons` says which setups found a mode, `left_out` which modes too few found.

    Raises
    ------
    DataError
        No result, or no output that all have.

    References
    ----------
    Reynders, Magalhaes, De Roeck and Cunha, "Merging strategies for multi-setup operational modal analysis: application to the Luiz I
    steel arch bridge", IMAC XXVII, 2009: post separate estimation re-scaling.

    Examples
    --------
    >>> from modalscope import mac
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> parts = [modes.select(outputs=["1:+X", "2:+X"]), modes.select(outputs=["1:+X", "4:+X", "5:+X"])]
    >>> merged = merge_modes(parts)
    >>> merged.output_dofs == modes.output_dofs, float(np.diag(mac(merged.shapes, modes.shapes)).min().round(9))
    (True, 1.0)
    """
    parts = check_each("results", results, "modes, one per setup")
    for part in parts:
        check_kind("each of the results", part, ModalModel)
    if not parts:
        raise DataError("modes of several setups:", "the list is empty", "Give the modes of each.")
    common = common_outputs(parts)
    labels = check_groups(groups, len(parts), "setup", tuple(f"setup {j + 1}" for j in range(len(parts))))
    given = None if responses is None else check_each("responses", responses, "one per setup")
    if given is not None and len(given) != len(parts):
        raise DataError(f"{len(parts)} responses:", f"{len(given)} are given", "Give one per result.")
    found = _together(parts, common, tolerance)
    enough = [mode for mode in found if 2 * len(mode) > len(parts)]
    kept = [mode for mode in enough if given is not None or len(mode) == len(parts)]
    left = [_candidate(mode, parts, mode in enough) for mode in found if mode not in kept]
    f, zeta = (np.array([_mean(mode, parts, name) for mode in kept]) for name in ("frequencies", "damping_ratios"))
    order = np.argsort(f, kind="stable")
    kept, f, zeta = [kept[k] for k in order], f[order], zeta[order]
    poles = poles_from(f, zeta)
    outputs = tuple(dict.fromkeys(dof for part in parts for dof in part.output_dofs))
    places = [indices_of("output", part.output_dofs, outputs) for part in parts]
    even = [np.ones(len(place)) for place in places]
    glues = [glued(x, even, places, len(outputs))[0] for x in _pieces(parts, kept, poles, given)]
    shapes = np.array(glues, dtype=complex).reshape(-1, len(outputs)).T
    repeated = None if labels is None or len(set(labels)) < LEAST_GROUPS else labels
    return ModalModel(
        poles=poles,
        shapes=shapes,
        output_dofs=outputs,
        quantity=parts[0].quantity,
        **_deviations(kept, parts, repeated),
        reasons=tuple(_reason(mode, parts) for mode in kept),
        left_out=tuple(left),
        notes=_notes(kept, parts, repeated),
        units=_units(parts, outputs),
        geometry=next((part.geometry for part in parts if part.geometry is not None), None),
        source_path=source_of(parts),
        scaling="as in the first setup",
        processing=(f"modes of {len(parts)} setups merged through {', '.join(common)}",),
    )


def _pieces(
    parts: Sequence[ModalModel], kept: Sequence[_Mode], poles: ComplexArray, responses: Sequence[Response] | None
) -> list[list[ComplexArray]]:
    """Return of every mode the part of its shape in each setup: of the results, or fitted to the responses with the poles of all."""
    if responses is None:
        return [[part.shapes[:, mode[j]] for j, part in enumerate(parts)] for mode in kept]
    whole = [_residues(response, poles) for response in responses]
    return [[shapes[:, k] for shapes in whole] for k in range(len(kept))]


def _together(parts: Sequence[ModalModel], common: tuple[str, ...], tolerance: float) -> list[_Mode]:
    """Return which modes of which setups are one by `same_modes`: frequencies may differ by `tolerance`, two standard deviations."""
    seen = [part.select(outputs=list(common)) for part in parts]
    found: list[_Mode] = []
    for j in sorted(range(len(parts)), key=lambda j: -len(parts[j])):
        ratios = [[log_ratios(seen[k].take([i]), seen[j], tolerance / 2)[0] for k, i in mode.items()] for mode in found]
        rows, columns = likeliest(
            np.array([np.mean(each, axis=0) for each in ratios]).reshape(len(found), len(seen[j]))
        )
        pairs = {int(b): int(a) for a, b in zip(rows, columns, strict=True)}
        for i in range(len(parts[j])):
            if i in pairs:
                found[pairs[i]][j] = i
            else:
                found.append({j: i})
    return found


def _values(mode: _Mode, parts: Sequence[ModalModel], name: str) -> tuple[RealArray, RealArray, RealArray | None]:
    """Return what the setups give, the weights of their mean, and their variances where all are known."""
    x = np.array([getattr(parts[j], name)[i] for j, i in mode.items()])
    stated = [(getattr(parts[j], f"{name}_std"), i) for j, i in mode.items()]
    variance = np.array([np.nan if std is None else std[i] ** 2 for std, i in stated])
    if not np.all(np.isfinite(variance) & (variance > 0)):
        return x, np.full(x.size, 1 / x.size), None
    return x, 1 / variance / np.sum(1 / variance), variance


def _mean(mode: _Mode, parts: Sequence[ModalModel], name: str) -> float:
    x, weights, _ = _values(mode, parts, name)
    return float(weights @ x)


def _deviations(kept: list[_Mode], parts: Sequence[ModalModel], labels: Groups) -> dict[str, Any]:
    """Return deviations of the means, from the noise and between groups of setups."""
    fields: dict[str, Any] = {}
    for name in _NAMES:
        values = [_values(mode, parts, name) for mode in kept]
        known = bool(kept) and all(variance is not None for _, _, variance in values)
        fields[f"{name}_std"] = np.array([np.sqrt(w**2 @ v) for _, w, v in values if v is not None]) if known else None
        between = labels and [_between(x, [labels[j] for j in m]) for (x, _, _), m in zip(values, kept, strict=True)]
        fields[f"{name}_repeatability"] = None if between is None else np.array(between)
    if labels and kept:
        std, apart = (
            np.array(
                [np.zeros(len(kept)) if fields[f"{name}_{end}"] is None else fields[f"{name}_{end}"] for name in _NAMES]
            )
            for end in ("std", "repeatability")
        )
        groups = len(set(labels))
        fields["degrees"] = degrees_of_wider(std, np.full(std.shape, np.inf), np.nan_to_num(apart), groups).T
    return fields


def _between(x: RealArray, labels: list[str]) -> float:
    """Return the deviation of the mean of groups; NaN of fewer than four."""
    means = np.array(
        [np.mean([a for a, own in zip(x, labels, strict=True) if own == label]) for label in dict.fromkeys(labels)]
    )
    return float(means.std(ddof=1) / np.sqrt(means.size)) if means.size >= LEAST_GROUPS else np.nan


def _residues(response: Response, poles: ComplexArray) -> ComplexArray:
    """Return the shapes of modes with these poles in a response, (l, n): leading vectors of the residues by least squares."""
    residues = free_residues(response.basis(poles, response.outside_powers))
    return np.linalg.svd(residues, full_matrices=False)[0][:, :, 0].T


def glued(
    pieces: Sequence[ComplexArray], deviations: Sequence[RealArray], places: Sequence[Sequence[int]], outputs: int
) -> tuple[ComplexArray, RealArray]:
    """Return the shape phi of which the pieces x_j are multiples, and the deviations of its outputs, (outputs,) each.

    min over phi and b of Q = sum_j |(x_j - b_j phi_j) / s_j|^2, in turn, the first piece as it is at first. With D = sum_j |b_j|^2 / s_j^2
    and G = phi_j conj(b_j) / (s_j^2 D), information on b_j sum |phi_j|^2 / s_j^2 and none on the size of all, the covariance of phi is
    D^-1 + G C G^*, C that of b; what lies along phi is no error of a shape. It is multiplied by Q over its degrees of freedom where that
    exceeds one.

    `deviations`: s_j of the outputs of each piece. `places`: those outputs among all.
    """
    weights = [1 / np.maximum(s, np.finfo(float).tiny) ** 2 for s in deviations]
    phi, D = np.zeros(outputs, dtype=complex), np.zeros(outputs)
    phi[places[0]], D[places[0]] = pieces[0], 1
    b = np.ones(len(pieces), dtype=complex)
    for _ in range(_MAX_ROUNDS):
        seen, total, D = D > 0, np.zeros(outputs, dtype=complex), np.zeros(outputs)
        for j, (x, w, place) in enumerate(zip(pieces, weights, places, strict=True)):
            known = w * seen[place]
            b[j] = known * phi[place].conj() @ x / max(known @ np.abs(phi[place]) ** 2, np.finfo(float).tiny)
            total[place] += w * b[j].conj() * x
            D[place] += w * abs(b[j]) ** 2
        phi = total / np.where(D > 0, D, 1)
    left, G, own = 0.0, np.zeros((outputs, len(b)), dtype=complex), np.zeros(len(b))
    for j, (x, w, place) in enumerate(zip(pieces, weights, places, strict=True)):
        left += float(w @ np.abs(x - b[j] * phi[place]) ** 2)
        own[j] = w @ np.abs(phi[place]) ** 2
        G[place, j] = w * phi[place] * b[j].conj() / D[place]
    C = np.linalg.pinv(np.diag(own) - (G.conj().T * D) @ G, rcond=_ROUNDING, hermitian=True)
    along = phi / max(float(np.linalg.norm(phi)), np.finfo(float).tiny)
    across = G - along[:, None] * (along.conj() @ G)
    size = np.abs(along) ** 2
    variance = (1 - 2 * size) / D + size * np.sum(size / D) + np.einsum("oj,jk,ok->o", across, C, across.conj()).real
    free = sum(map(len, pieces)) - outputs - len(b) + 1
    return phi, np.sqrt(np.maximum(variance * max(1.0, left / max(free, 1)), 0))


def _reason(mode: _Mode, parts: Sequence[ModalModel]) -> dict[str, object]:
    x = _values(mode, parts, "frequencies")[0]
    scatter = f"{100 * x.std(ddof=1) / x.mean():.3f} %" if x.size > 1 else "-"
    return {"setups": f"found in {len(mode)} of {len(parts)}", "scatter of f": scatter}


def _candidate(mode: _Mode, parts: Sequence[ModalModel], enough: bool) -> Candidate:
    where = ", ".join(str(j + 1) for j in sorted(mode))
    return Candidate(
        frequency=_mean(mode, parts, "frequencies"),
        damping_ratio=_mean(mode, parts, "damping_ratios"),
        reason=f"only {len(mode)} of {len(parts)} setups have it: {where}",
        remedy="Give the responses, too: its shape is then fitted where it is missing"
        if enough
        else "Give its frequency: frequencies=[...] in every setup, or identify the setups together",
    )


def _notes(kept: list[_Mode], parts: Sequence[ModalModel], labels: Groups) -> tuple[Note, ...]:
    lacking = sum(len(mode) < len(parts) for mode in kept)
    notes = [] if labels else [Note("groups", {}, "Fewer than four setups: repeatability is not known")]
    if lacking:
        text = f"{lacking} modes are missing in some setups: their shapes there are fitted with the poles of the others"
        notes.append(Note("shapes", {"modes": lacking}, text))
    return tuple(notes)


def _units(parts: Sequence[ModalModel], outputs: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    known = {dof: unit for part in parts for dof, unit in zip(part.output_dofs, part.units[0], strict=True)}
    return tuple(known[dof] for dof in outputs), ()
