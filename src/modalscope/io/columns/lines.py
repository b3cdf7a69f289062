"""Build frequency responses from columns: real and imaginary parts, magnitude and phase, coherence."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import islice, product, takewhile
from typing import Any, TypeAlias

import numpy as np

from modalscope.data import DataError, FrequencyResponse
from modalscope.data.shown import figures
from modalscope.data.units import plain_unit, unbracketed
from modalscope.io.arrays import joined
from modalscope.io.columns.table import Column, Table, as_word, span
from modalscope.io.columns.vocabulary import COLUMNS, MAX_CHARACTERS, folded, meanings_of
from modalscope.io.columns.words import factor_to_base, kind_of_unit, labels_of
from modalscope.io.contents import needs
from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: A part with what joins it to a name: `Parte reale di`, `(Imag.)`, `[Re]`, `Real part of`.
_PATTERNS = {
    part: re.compile(
        rf"(?<![a-z0-9])(?P<open>[(\[{{]\s*)?(?:part(?:e|ie)?\s+)?(?:{'|'.join(sorted(COLUMNS[part].split(), key=len, reverse=True))})"
        r"(?![a-z])\.?(?:\s+part(?:\s+of)?)?(?:\s+(?:of|von|der|de|du|di|del|van|av|da|do)\b)?(?(open)(?:\s*[)\]}])?)"
    )
    for part in ("real", "imag", "mag", "phase", "coh")
}
_BARS = re.compile(r"\|([^|]+)\|\Z")
_DECIBEL = re.compile(r"(?<![A-Za-z])d[bB](?![A-Za-z])")
#: Phases whose largest lies between these bounds (rad) are radians: a resonance turns by more than three degrees.
_BOUNDS_OF_RADIANS = (2.0, 2 * np.pi + 0.01)
#: Parts that `--columns` may name, and which of them make one complex value.
_FAMILY_OF_PART = {"real": "parts", "imag": "parts", "mag": "polar", "phase": "polar", "coh": "coherence"}
#: Whether words of `--columns` read the table at hand.
Works: TypeAlias = Callable[[str], bool]
#: Values and both units of responses by output and input.
Responses: TypeAlias = dict[tuple[str, str], tuple[Array, tuple[str, str]]]
#: The parts of one response by what they are.
Parts = dict[str, Column]

#: The input where no name says one.
_ONLY_INPUT = "u1"
_PREFIX = re.compile(r"^(?:frequency response|frf|transfer function|tf|h[12v]?)(?![A-Za-z0-9])[\s:_(]*", re.IGNORECASE)
_PAIR = re.compile(r"^(?P<out>[^/]+?)\s*(?:/|<-|->)\s*(?P<in>[^/]+?)$")
_OTHER_PART = {"real": "imag", "imag": "real", "mag": "phase", "phase": "mag"}
WORDS_OF_PARTS = {
    "real": "real part",
    "imag": "imaginary part",
    "mag": "magnitude",
    "phase": "phase",
    "coh": "coherence",
}


def part_of(name: str) -> tuple[str, str] | None:
    """Return what a column belongs to and which part of it it is; None where its name says nothing of it.

    Examples
    --------
    >>> part_of("H11 Real"), part_of("Im(H11)"), part_of("|3Z/1Z|"), part_of("Phase"), part_of("AccA")
    (('H11', 'real'), ('H11', 'imag'), ('3Z/1Z', 'mag'), ('', 'phase'), None)
    >>> part_of("(3Z)/(1Z) Real")
    ('(3Z)/(1Z)', 'real')
    """
    text = name.strip()[:MAX_CHARACTERS]
    bars = _BARS.match(text)
    if bars:
        return bars[1].strip(), "mag"
    for part, pattern in _PATTERNS.items():
        match = pattern.search(folded(text))
        if match:
            rest = _DECIBEL.sub("", text[: match.start()] + " " + text[match.end() :])
            return " ".join(_unwrapped(rest).split()), part
    return None


def _unwrapped(text: str) -> str:
    """Return what is left of a name without the brackets and signs that joined the part to it."""
    while (bare := unbracketed(text).strip(" _-.,:;|")) != text:
        text = bare
    return text if text.count("(") == text.count(")") else text.strip("() ")


def is_decibel(name: str, unit: str) -> bool:
    """Whether a magnitude is a level, by its unit or its name.

    Examples
    --------
    >>> is_decibel("Mag", "dB"), is_decibel("Mag dB re 1 m/s2/N", ""), is_decibel("Mag", "g/N")
    (True, True, False)
    """
    return bool(_DECIBEL.search(unit) or _DECIBEL.search(name))


def from_decibels(levels: RealArray) -> RealArray:
    """Return 10^(L/20) of levels L in decibels of an amplitude."""
    with np.errstate(over="ignore"):
        return np.asarray(10.0 ** (levels / 20))


def phase_unit(unit: str, phases: RealArray) -> str:
    """Return "deg" or "rad": what a phase is in, by its unit or else by its range; "" where neither says.

    Beyond 2 pi it cannot be within one turn in radians. Between 2 and 2 pi it is radians, for a response that turns through a
    resonance covers more than that many degrees.

    Examples
    --------
    >>> [phase_unit(unit, np.array([p])) for unit, p in (("°", 1.0), ("", -170.0), ("", -3.1), ("", 0.5))]
    ['deg', 'deg', 'rad', '']
    """
    plain = plain_unit(unit).lower()
    if plain.startswith(("deg", "grad")):
        return "deg"
    if plain.startswith("rad"):
        return "rad"
    largest = float(np.abs(phases).max(initial=0.0))
    return "deg" if largest > _BOUNDS_OF_RADIANS[1] else "rad" if largest > _BOUNDS_OF_RADIANS[0] else ""


def joined_polar(where: str, magnitude: Array, phase: Array, unit: str, example: str) -> ComplexArray:
    """Return m exp(j phi).

    `magnitude`, `phase` (N,). `unit`: "deg", "rad", or "" where it is not known. `example`: how `--units` names the phase.

    Raises `DataError`: a phase whose unit is not known.
    """
    if not unit:
        fault = f"they lie within {figures(np.abs(phase).max(initial=0.0))} of zero, which may be degrees or radians"
        remedy = f'Say which: --units "{example}=deg" or --units "{example}=rad".'
        raise needs(where, "the unit of its phases", fault, remedy)
    factor = np.exp(1j * (np.deg2rad(phase) if unit == "deg" else phase))
    return np.asarray(magnitude * factor, complex)


def parts_of_responses(
    columns: Sequence[Column], roles: Mapping[int, str], option_roles: Mapping[int, str]
) -> dict[tuple[str, int], Parts]:
    """Return parts by the name of what they belong to.

    What `--columns` names is paired by place: the first real part with the first imaginary one. Other parts are paired by the stems of
    their names where all have their other so; else by place, too.

    `roles`: what each column is. `option_roles`: what `--columns` says.
    """
    groups = _by_place([c for c in columns if option_roles.get(c.number) in _FAMILY_OF_PART], option_roles)
    rest = [c for c in columns if option_roles.get(c.number) not in _FAMILY_OF_PART]
    named = _by_stem(rest, roles)
    halves = [(part, parts) for parts in named.values() for part in parts if part in _OTHER_PART]
    alone = {part for part, parts in halves if _OTHER_PART[part] not in parts}
    if alone and all(_other_count(named, part) for part in alone):
        named = {key: parts for key, parts in named.items() if not set(parts) & set(_OTHER_PART)}
        named |= _by_place([c for c in rest if roles.get(c.number) in _OTHER_PART], roles)
    for (base, place), parts in named.items():
        while (base, place) in groups:
            place += 1
        groups[base, place] = parts
    return groups


def _is_whole(parts: Parts) -> bool:
    """Whether parts are a complex response."""
    return "complex" in parts or {"real", "imag"} <= set(parts) or {"mag", "phase"} <= set(parts)


def _other_count(groups: Mapping[tuple[str, int], Parts], part: str) -> bool:
    """Whether there are as many columns of a part as of its other."""
    these, others = ([each in parts for parts in groups.values()] for each in (part, _OTHER_PART[part]))
    return sum(these) == sum(others)


def _by_stem(columns: Sequence[Column], roles: Mapping[int, str]) -> dict[tuple[str, int], Parts]:
    """Return parts by the names that are left without the words for the part; where names repeat the first goes with the first."""
    groups: dict[tuple[str, int], Parts] = {}
    for column in columns:
        part = roles.get(column.number, "")
        if part not in ("complex", *_FAMILY_OF_PART):
            continue
        named = part_of(column.name)
        base, place = column.name if named is None or part == "complex" else named[0], 0
        while part in groups.setdefault((base, place), {}):
            place += 1
        groups[base, place][part] = column
    return groups


def _by_place(columns: Sequence[Column], roles: Mapping[int, str]) -> dict[tuple[str, int], Parts]:
    """Return parts by their order: the k-th real part and the k-th imaginary one are one response, likewise polar ones."""
    order: dict[str, list[Column]] = {part: [] for part in _FAMILY_OF_PART}
    for column in columns:
        order[roles[column.number]].append(column)
    groups: dict[tuple[str, int], Parts] = {}
    for part, columns_of_part in order.items():
        for k, column in enumerate(columns_of_part):
            groups.setdefault((_FAMILY_OF_PART[part], k), {})[part] = column
    named: dict[tuple[str, int], Parts] = {}
    for parts in sorted(groups.values(), key=lambda parts: min(column.number for column in parts.values())):
        base = _shared_stem(parts)
        named[base, sum(name == base for name, _ in named)] = parts
    return named


def _shared_stem(parts: Parts) -> str:
    """Return the name that columns share: without their parts, or what all names begin with; empty where they share none."""
    names = [column.name if (named := part_of(column.name)) is None else named[0] for column in parts.values()]
    shared = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    return names[0] if len(set(names)) == 1 else _unwrapped("".join(letters[0] for letters in shared))


def frequency_response(
    table: Table,
    axis: Column,
    columns: Sequence[Column],
    roles: Mapping[int, str],
    option_roles: Mapping[int, str],
    works: Works,
) -> tuple[FrequencyResponse, list[str], dict[int, str]]:
    """Return frequency responses, notes, and what is ignored with its reason.

    `axis`: the frequencies. `columns`: all others that may be taken. `roles`: what each is. `option_roles`: what `--columns` says. `works`:
    whether the table is read with other words of `--columns`.

    Raises `DataError`: magnitudes without phases, a part without its other, an unknown unit of phases, pairs that make no matrix.
    """
    groups = parts_of_responses(columns, roles, option_roles)
    pairs = _pairs_of([f"{base} {place + 1}" if base and place else base for base, place in groups])
    notes: list[str] = []
    used: dict[int, str] = {}
    responses: Responses = {}
    coherences: list[tuple[str, Column]] = []
    for ((base, _), parts), (out, into) in zip(groups.items(), pairs, strict=True):
        if set(parts) == {"coh"}:
            coherences.append((base, parts["coh"]))
            continue
        values = _values(table, parts, notes)
        if values is None and set(parts) == {"mag"} and any(_is_whole(other) for other in groups.values()):
            continue  # a magnitude beside complex values adds nothing to them
        if values is None:
            raise _incomplete(table, axis, parts, groups, option_roles)
        first = next(iter(parts.values()))
        responses[out or f"y{len(responses) + 1}", into] = (values, _unit_pair(first.unit))
        used |= {column.number: "" for column in parts.values()}
        coherences += [(base, parts["coh"])] if "coh" in parts else []
    if len(responses) > 1 and {into for _, into in responses} == {_ONLY_INPUT}:
        notes.append("no name is a pair such as 3Z/1Z: all responses are taken as those to one input")
    if not responses:
        raise _no_phases(table, axis, columns, works)
    unused = {column.number: "it belongs to no frequency response" for column in columns if column.number not in used}
    outputs, inputs, units, values = matrix_of(table.where, responses)
    coherence = _coherence(coherences, outputs, inputs, unused)
    quantities = {kind_of_unit(unit) for unit in units[0]} & {"acceleration", "velocity", "displacement"}
    thing = FrequencyResponse(
        values=np.asarray(values, complex),
        frequencies=axis.values * factor_to_base(axis.unit),
        quantity=quantities.pop() if len(quantities) == 1 else None,
        output_dofs=outputs,
        input_dofs=inputs,
        units=units,
        coherence=coherence,
    )
    return thing, notes, unused


def _pairs_of(bases: Sequence[str]) -> list[tuple[str, str]]:
    """Return output and input of names such as `H(3Z/1Z)`; without a pair every name is an output of one input."""
    sides: list[str] = []
    for base in bases:
        match = _PAIR.match(_PREFIX.sub("", base).strip(" )(") or base)
        paired = match and (kind_of_unit(match["in"]) == "" or match["in"].isdecimal())
        sides += [match["out"].strip(), match["in"].strip()] if match and paired else [base, _ONLY_INPUT]
    labels = labels_of(sides)
    return list(zip(labels[::2], labels[1::2], strict=True))


def _values(table: Table, parts: Parts, notes: list[str]) -> Array | None:
    """Return complex values; None where a part lacks its other."""
    if "complex" in parts:
        return parts["complex"].values
    if {"real", "imag"} <= set(parts):
        return joined(parts["real"].values, parts["imag"].values)
    if {"mag", "phase"} <= set(parts):
        magnitude, phase = parts["mag"], parts["phase"]
        levels = is_decibel(magnitude.name, magnitude.unit) or bool(magnitude.values.min() < 0)
        unit = phase_unit(phase.unit, phase.values)
        words = "decibels (20 log10)" if levels else "amplitudes"
        why = f"degrees or radians by {'their unit' if phase.unit else 'their range'}"
        notes.append(f"magnitudes are read as {words}, phases as {'degrees' if unit == 'deg' else 'radians'} ({why})")
        size = from_decibels(magnitude.values) if levels else magnitude.values
        return joined_polar(table.where, size, phase.values, unit, phase.name or str(phase.number))
    return None


def _incomplete(
    table: Table, axis: Column, parts: Parts, found: Mapping[tuple[str, int], Parts], option_roles: Mapping[int, str]
) -> DataError:
    """Return the error of a part that lacks its other; the example names columns where as many of both kinds are left."""
    part = next(part for part in parts if part in _OTHER_PART)
    first = part if part in ("real", "mag") else _OTHER_PART[part]
    second = _OTHER_PART[first]
    groups = found.values()
    alone = {kind: [g[kind].number for g in groups if {first, second} & set(g) == {kind}] for kind in (first, second)}
    example = [f"{first}={a},{second}={b}" for a, b in zip(alone[first], alone[second], strict=False)]
    example = [f"frequency={axis.number}", *example] if axis.number and example else example
    whole = any(len(group) > 1 or "complex" in group for group in groups)
    ways = [f"leave the column out: --ignore {as_word(parts[part].label)}"] if whole else []
    ways += [f'say what the columns are: --columns "{",".join(example)}"'] if example else []
    remedy = ", or ".join(["Export it", *ways]) + ("" if ways else ".")
    if option_roles.get(parts[part].number) == part:
        remedy = f"Name as many columns {_OTHER_PART[part]}= as {part}= in --columns, in the same order."
    fault = f"{parts[part]} has no {WORDS_OF_PARTS[_OTHER_PART[part]]} with it"
    return needs(table.where, "complex values", fault, remedy)


def _no_phases(table: Table, axis: Column, columns: Sequence[Column], works: Works) -> DataError:
    """Return the error of real columns over frequency, with the options that read them otherwise."""
    numbers = [column.number for column in columns]
    remedy = "Export real and imaginary parts, or magnitudes and phases; spectra alone hold no phases to identify from."
    options = []
    if len(numbers) % 2 == 0 and not any("spectrum" in dict(meanings_of(column.name)) for column in columns):
        pairs = list(zip(numbers[::2], numbers[1::2], strict=True))
        signed = any(np.min(column.values, initial=0.0) < 0 for column in columns)
        kinds = [("real", "imag")] if signed else []
        options = [",".join(f"{a}={one},{b}={other}" for one, other in pairs) for a, b in (*kinds, ("mag", "phase"))]
        options = [f"frequency={axis.number},{parts}" for parts in options]
    if not axis.unit and "frequency" not in dict(meanings_of(axis.name)):
        options.append(f"time={axis.number},out={span(numbers)}")
    said = [f'--columns "{option}"' for option in options if works(option)]
    if said:
        remedy += f" If they are something else, say what: {', or '.join(said)}."
    words = f"column {span(numbers)} is" if len(numbers) == 1 else f"columns {span(numbers)} are"
    fault = f"{words} real ({', '.join(column.label for column in columns[:6])})"
    return needs(table.where, "complex values with its frequencies", fault, remedy)


def matrix_of(where: str, responses: Responses) -> tuple[Any, Any, Any, Array]:
    """Return outputs, inputs, their units and values (lines, outputs, inputs) of responses by output and input, each with both units.

    Raises `DataError`: a pair is missing.
    """
    outputs = tuple(dict.fromkeys(out for out, _ in responses))
    inputs = tuple(dict.fromkeys(into for _, into in responses))
    # few of them are named: pairs grow with the square of a file's columns
    missing = list(islice((f"{o} / {i}" for o, i in product(outputs, inputs) if (o, i) not in responses), 6))
    if missing:
        fault = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        remedy = "Export them, or leave the others of that channel out with --ignore."
        raise needs(where, "a response of every output to every input", fault, remedy)
    units = (
        tuple(responses[o, inputs[0]][1][0] for o in outputs),
        tuple(responses[outputs[0], i][1][1] for i in inputs),
    )
    values = np.stack([np.stack([responses[o, i][0] for i in inputs], axis=-1) for o in outputs], axis=1)
    return outputs, inputs, units, values


def _unit_pair(unit: str) -> tuple[str, str]:
    """Return the units of output and input in that of a ratio, `m/s2/N` or `(m/s^2)/(N)`."""
    above, slash, below = unbracketed(unit).rpartition("/")
    if slash and kind_of_unit(below) == "force":
        return unbracketed(above), unbracketed(below)
    return ("", "") if is_decibel("", unit) else (unit, "")


def _coherence(
    coherences: Sequence[tuple[str, Column]], outputs: Sequence[str], inputs: Sequence[str], unused: dict[int, str]
) -> Array | None:
    """Return coherence where there is one for every output, in the order of the responses."""
    if not coherences or len(coherences) != len(outputs) * len(inputs):
        return None
    values = np.stack([column.values for _, column in coherences], axis=-1)
    if values.min() < 0 or values.max() > 1 + 1e-6:
        unused |= {column.number: "a coherence lies between 0 and 1" for _, column in coherences}
        return None
    for _, column in coherences:
        unused.pop(column.number, None)
    return np.asarray(values.reshape(-1, len(outputs), len(inputs)))
