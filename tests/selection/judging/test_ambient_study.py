"""What ambient records give with nothing set, over many random structures, machines and records of noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from tests.selection.judging.ambient_records import Ambient, beside_a_machine, random_structure
from tests.studies import Study


def paired(structure: Ambient, modes: ms.ModalModel) -> list[tuple[int, int]]:
    """Return (mode of the structure, found mode), each once: within 1 % or two half bandwidths."""
    pairs: list[tuple[int, int]] = []
    for i, (f, zeta) in enumerate(zip(structure.frequencies, structure.damping_ratios, strict=True)):
        free = [j for j in range(len(modes)) if j not in [k for _, k in pairs]]
        near = [j for j in free if abs(modes.frequencies[j] - f) < max(0.01, 2 * zeta) * f]
        if near:
            pairs.append((i, min(near, key=lambda j: abs(modes.frequencies[j] - f))))
    return pairs


def tried(seeds: range, times: float) -> tuple[float, float]:
    """Return the part of records whose modes are all found and nothing else, and the median damping error over that of Au's law."""
    perfect, errors = [], []
    for seed in seeds:
        structure = random_structure(seed)
        modes = ms.analyze(structure.record(times, 1000 + seed)).modes
        pairs = paired(structure, modes)
        perfect.append(len(pairs) == len(structure.frequencies) == len(modes))
        errors += [
            (modes.damping_ratios[j] / structure.damping_ratios[i] - 1) / structure.damping_law[i] for i, j in pairs
        ]
    return float(np.mean(perfect)), float(np.median(np.abs(errors)))


@pytest.mark.study("ambient")
@pytest.mark.parametrize("times", [1, 5, 15])
def test_random_structures_at_a_sensible_rate_and_at_five_and_fifteen_times_it(
    times: float, study: Callable[[str, str], Study]
) -> None:
    perfect, error = tried(range(200, 240), times)
    table = study(f"random structures, sampled {times} times as fast as needed", "40 records, seeds 200 to 239")
    table.row("records with all modes and no others", 100 * perfect, least=95, unit=" %")
    table.row("median damping error over that of Au's law", error, most=1.3)
    assert not table.missed


@pytest.mark.study("harmonics")
@pytest.mark.parametrize("wander", [0, 0.003])
def test_harmonics_are_flagged_and_are_none_of_the_modes(wander: float, study: Callable[[str, str], Study]) -> None:
    flagged, among, kept, cases = [], 0, [], 0
    for seed in range(300, 320):
        machine = beside_a_machine(seed, wander)
        # what turns fewer than a thousand times is not told from a mode of .1 % damping
        if machine.lines[0] * machine.structure.duration < 1500:
            continue
        cases += 1
        modes = ms.analyze(machine.record).modes
        known = np.array([h.frequency for h in modes.harmonics])
        flagged += [bool(np.any(np.abs(known / f - 1) < 0.004)) for f in machine.lines]
        pairs = paired(machine.structure, modes)
        kept += [i in [k for k, _ in pairs] for i in range(len(machine.structure.frequencies))]
        others = [j for j in range(len(modes)) if j not in [k for _, k in pairs]]
        among += sum(np.min(np.abs(machine.lines / modes.frequencies[j] - 1)) < 0.01 for j in others)
    speed = f"wandering by {100 * wander:g} %" if wander else "constant"
    table = study(f"ambient records with a machine, speed {speed}", f"{cases} records of seeds 300 to 319")
    table.row("harmonics that are flagged", 100 * np.mean(flagged), least=100, unit=" %")
    table.row("harmonics among the modes", among, most=0)
    table.row("modes that are found", 100 * np.mean(kept), least=100, unit=" %")
    assert not table.missed
