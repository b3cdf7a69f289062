"""Places left out of measured tests: is the place that is foretold to help most the one that then does?

Of every case some sensors and forces are analysed, and again with each of four places more. Where modes of the whole test tell the residues
there, the deviations that are then stated of damping ratios are held against those foretold. Named are the places that `next` could not
tell apart, as their noise is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.planning.foretold import deviations_foretold, information, slopes_left
from modalscope.analysis.planning.next_measurement import TOLD_APART, _Test, not_told_apart, scatter_of_noise
from modalscope.numerics.checks import Array, RealArray
from tests.analysis.planning.planned import PLACES, structure
from tests.studies import Study
from tests.support import measured

#: Lead of the first place over the second by which it is ahead.
AHEAD = 1.1


@dataclass(frozen=True)
class Told:
    """A mode of a case: foretold and then stated deviations of its damping over those before, (4,), and whether disagreement rules.

    `doubt` (4,): standard deviations of the logarithms of those foretold, from the noise of the new place.
    """

    foretold: RealArray
    doubt: RealArray
    stated: RealArray
    disagrees: bool

    @property
    def ahead(self) -> bool:
        first, second = np.sort(self.foretold)[:2]
        return bool(AHEAD * first <= second)

    @property
    def over_best(self) -> float:
        """What the first place reached over the best of all."""
        return float(self.stated[np.argmin(self.foretold)] / self.stated.min())

    @property
    def named(self) -> list[int]:
        return not_told_apart(-np.log(self.foretold), self.doubt)


def paired(modes: ms.ModalModel, other: ms.ModalModel) -> Array:
    """Return for every mode the one of another list within .6 half bandwidths whose damping is within a factor of 1.65; else -1."""
    f, z, found = modes.frequencies, modes.damping_ratios, list[int]()
    for k in range(len(modes)):
        j = int(np.argmin(np.abs(other.frequencies - f[k]))) if len(other) else -1
        near = j >= 0 and abs(other.frequencies[j] - f[k]) < 0.6 * f[k] * z[k] + 1e-4 * f[k]
        found.append(j if near and abs(np.log(other.damping_ratios[j] / z[k])) < 0.5 else -1)
    return np.array(found)


def foretold(test: _Test, sides: tuple[list[int], list[int]], place: tuple[bool, int], residues: Array) -> RealArray:
    """Return deviations of damping with one place more, as foretold and with its noise a standard deviation above that, (2, n).

    `place`: (an output of the modes?, its index in the whole test).

    `sides`: outputs and inputs of the modes by their indices in the whole test. `residues` (L, M, n): of the whole test, of these modes.
    """
    (outputs, inputs), (output, k) = sides, place
    noise = np.log(test._noise[: len(outputs), : len(inputs)])
    more = residues[k, inputs][None] if output else residues[outputs, k][:, None]
    level = np.exp(noise.mean(axis=0))[None] if output else np.exp(noise.mean(axis=1))[:, None]
    products = slopes_left(test._response, test.modes.poles)
    known = test._told[: len(outputs), : len(inputs)].sum(axis=(0, 1))
    told = information(products, more / level[:, :, None]).sum(axis=(0, 1))
    louder = scatter_of_noise(noise if output else noise.T)
    return np.array([deviations_foretold(known + told * np.exp(-2 * by), test.modes.poles)[1] for by in (0.0, louder)])


def case(
    data: ms.FrequencyResponse,
    band: tuple[float, float] | None,
    sides: tuple[list[int], list[int]],
    places: list[tuple[bool, int]],
    whole: ms.ModalModel,
) -> Iterator[Told]:
    """Analyse sensors and forces, and again with each place more (a sensor?, its index); yield each mode that has an interval."""
    chosen = {} if band is None else {"band": band}
    test = _Test(ms.analyze(data.select(outputs=sides[0], inputs=sides[1]), **chosen))
    modes, turned = test.modes, test._response.exchanged
    assert modes.degrees is not None
    assert modes.damping_ratios_std is not None
    of_whole = paired(modes, whole)
    residues = np.where(
        of_whole >= 0, np.einsum("ok,ki->oik", whole.shapes, whole.known_participation(""))[:, :, of_whole], 0
    )
    own = sides[::-1] if turned else sides
    both = np.array([foretold(test, own, (s != turned, k), residues) for s, k in places])
    after, doubt = both[:, 0] / test._before["damping"], np.log(both[:, 1] / both[:, 0])
    stated = np.full(after.shape, np.nan)
    for row, (sensor, k) in enumerate(places):
        more = sorted([*sides[0], k]) if sensor else sides[0], sides[1] if sensor else sorted([*sides[1], k])
        then = ms.analyze(data.select(outputs=more[0], inputs=more[1]), **chosen).modes
        j = paired(modes, then)
        if then.damping_ratios_std is not None:
            relative = (
                (then.damping_ratios_std / then.damping_ratios)[j] * modes.damping_ratios / modes.damping_ratios_std
            )
            stated[row] = np.where(j >= 0, relative, np.nan)
    known = (of_whole >= 0) & (modes.degrees[:, 1] != 0) & np.isfinite(modes.damping_ratios_std)
    for m in np.flatnonzero(known):
        yield Told(after[:, m], doubt[:, m], stated[:, m], bool(test.disagree["damping"][m]))


def beam() -> Iterator[Told]:
    data, band = ms.datasets.load("beam_hammer"), (100.0, 5000.0)
    whole = ms.analyze(data, band=band).modes
    for seed in range(71000, 71011):
        draw = np.random.default_rng(seed)
        S, F = draw.permutation(7), draw.permutation(6)
        places = [(True, int(k)) for k in S[3:5]] + [(False, int(k)) for k in F[3:5]]
        yield from case(data, band, (sorted(S[:3].tolist()), sorted(F[:3].tolist())), places, whole)


def aircraft() -> Iterator[Told]:
    held, band = np.load(measured("hati_gvt", "hati_ws3_frf.npz")), (3.0, 36.0)
    data = ms.FrequencyResponse(values=held["H"][:, :, None], frequencies=held["freq"], quantity="acceleration")
    whole = ms.analyze(data, band=band).modes
    for seed in range(72000, 72016):
        S = np.random.default_rng(seed).permutation(20)
        yield from case(data, band, (sorted(S[:4].tolist()), [0]), [(True, int(k)) for k in S[4:8]], whole)


def roving() -> Iterator[Told]:
    data = ms.read(measured("roving_pair", "roving.uff"))
    whole = ms.analyze(data).modes
    for seed in range(73000, 73013):
        F = np.random.default_rng(seed).permutation(15)
        yield from case(data, None, ([0, 1], sorted(F[:4].tolist())), [(False, int(k)) for k in F[4:8]], whole)


def uneven() -> Iterator[Told]:
    """Random structures whose noise differs by channel, 1 : 2, and along the band, by four waves of up to one neper."""
    for seed in range(74000, 74024):
        made, draw = structure(seed), np.random.default_rng(seed)
        every, f = list(range(PLACES)), made.frequencies
        clean = replace(made, noise=np.zeros(PLACES)).response(every, every, 1.0, 0)
        level = np.exp(np.log(made.noise).mean()) * 10 ** draw.uniform(-0.15, 0.15, (PLACES, PLACES))
        along = (f - f[0]) / (f[-1] - f[0])
        size, phase = draw.uniform(0, 1, (4, PLACES, PLACES)), draw.uniform(0, 2 * np.pi, (4, PLACES, PLACES))
        waves = 2 * np.pi * np.arange(1, 5)[:, None, None] * along[:, None, None, None] / 1.5
        level = level * np.exp(np.einsum("koi,fkoi->foi", size, np.cos(waves + phase)))
        noise = draw.standard_normal(clean.values.shape) + 1j * draw.standard_normal(clean.values.shape)
        S, F = draw.permutation(PLACES), draw.permutation(PLACES)
        places = [(True, int(k)) for k in S[4:6]] + [(False, int(k)) for k in F[2:4]]
        sides = sorted(S[:4].tolist()), sorted(F[:2].tolist())
        yield from case(replace(clean, values=clean.values + level * noise), None, sides, places, made.modes(every))


CASES = {
    "random structures, noise uneven, 4 sensors and 2 forces of 12": (uneven, "24 draws, seeds 74000 to 74023"),
    "shipped beam, 3 of 7 sensors and 3 of 6 forces": (beam, "11 draws, seeds 71000 to 71010"),
    "aircraft, 4 of 20 sensors, one shaker": (aircraft, "16 draws, seeds 72000 to 72015"),
    "roving hammer, 2 sensors, 4 of 15 places": (roving, "13 draws, seeds 73000 to 73012"),
}


def record(told: Study, modes: list[Told]) -> None:
    """Write the rows of a test: modes that noise rules, and those that disagreement rules."""
    told.row("modes whose damping disagreement rules", float(np.mean([m.disagrees for m in modes])))
    for name, some in (
        ("noise rules", [m for m in modes if not m.disagrees]),
        ("disagreement rules", [m for m in modes if m.disagrees]),
    ):
        ahead = [m for m in some if m.ahead and np.isfinite(m.stated).all()]
        told.row(f"{name}: modes of which a place is ahead by a tenth", f"{len(ahead)} of {len(some)}")
        if ahead:
            asked = 0.8 if name == "noise rules" else None
            told.row(
                f"{name}: the place ahead was the best of four",
                float(np.mean([m.over_best == 1 for m in ahead])),
                least=asked,
            )
            told.row(
                f"{name}: it came within a tenth of the best", float(np.mean([m.over_best < AHEAD for m in ahead]))
            )
    record_named(
        told, [(int(np.argmin(m.stated)), m.named) for m in modes if not m.disagrees and np.isfinite(m.stated).all()]
    )


def record_named(told: Study, found: list[tuple[int, list[int]]]) -> None:
    """Write the rows of (best place, places named)."""
    alone = [best == named[0] for best, named in found if len(named) == 1]
    told.row(
        "noise rules: the best of four was among those named",
        float(np.mean([best in named for best, named in found])),
        least=TOLD_APART,
    )
    told.row("noise rules: places named of four, mean", float(np.mean([len(named) for _, named in found])))
    told.row("noise rules: modes of which one place alone is named", f"{len(alone)} of {len(found)}")
    if alone:
        told.row("noise rules: that place was the best of four", float(np.mean(alone)))


@pytest.mark.study("planning")
@pytest.mark.parametrize("name", CASES)
def test_places_left_out(study: Callable[[str, str], Study], name: str) -> None:
    made, seeds = CASES[name]
    record(study(f"{name}; four places left out", seeds), list(made()))


@pytest.mark.study("planning")
@pytest.mark.parametrize("by", ["channel", "place"])
def test_places_whose_noise_is_random(study: Callable[[str, str], Study], by: str) -> None:
    """Log-normal noise alone decides: the true deviations are those foretold with the noise of the new place known."""
    told = study(
        f"4 sensors and 2 forces of 12, log-normal noise by {by}, a factor of 1.6; four sensors left out, nothing else unknown",
        "100 seeds, 75000 to 75099",
    )
    found: list[tuple[int, list[int]]] = []
    for seed in range(75000, 75100):
        made, draw = structure(seed), np.random.default_rng(seed)
        S, F = draw.permutation(PLACES)[:8], draw.permutation(PLACES)[:2]
        levels = np.log(1.6) * (
            draw.standard_normal((8, 2)) if by == "channel" else draw.standard_normal((8, 1)) + np.zeros(2)
        )
        told_by = information(
            slopes_left(made.response([0], [0], 1.0, 0), made.poles),
            np.einsum("ok,ik->oik", made.shapes[S], made.shapes[F]) / (2j * made.poles.imag),
        )
        known = np.einsum("oi,oiab->ab", np.exp(-2 * levels[:4]), told_by[:4])
        mean, doubt = levels[:4].mean(axis=0), scatter_of_noise(levels[:4])
        foretold, louder, true = (
            np.log(
                [
                    deviations_foretold(known + np.einsum("i,iab->ab", np.exp(-2 * level), told_by[k]), made.poles)[1]
                    for k, level in zip(range(4, 8), each, strict=True)
                ]
            )
            for each in ([mean] * 4, [mean + doubt] * 4, levels[4:])
        )
        found += [
            (int(np.argmin(true[:, k])), not_told_apart(-foretold[:, k], (louder - foretold)[:, k]))
            for k in range(len(made.poles))
        ]
    record_named(told, found)
