"""The measured and simulated data of the standing comparison, each with the values that its authors or its equations give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import modalscope as ms
from modalscope import systems
from tests.support import measured

#: 40 dB.
NOISE = 0.01


@dataclass(frozen=True)
class Case:
    """A data set, how it is compared, and reference values: frequency in Hz and damping in per cent (None where not known)."""

    name: str
    what: str
    load: Callable[[], Any]
    options: dict[str, Any] = field(default_factory=dict)
    reference: tuple[tuple[float, float | None], ...] = ()
    exact: bool = False


def _arrays(folder: str, name: str) -> Any:
    with np.load(measured(folder, name), allow_pickle=False) as held:
        return dict(held)


def beam_hammer() -> ms.FrequencyResponse:
    z = _arrays("beam_hammer", "beam_mimo_frf.npz")
    return ms.FrequencyResponse(values=z["H"].transpose(2, 1, 0), frequencies=z["freq"], quantity="acceleration")


def beam_uff() -> Any:
    return ms.read(measured("beam_uff", "beam_2kHz.uff"))


def hati_gvt() -> ms.FrequencyResponse:
    z = _arrays("hati_gvt", "hati_ws3_frf.npz")
    return ms.FrequencyResponse(values=z["H"][:, :, None], frequencies=z["freq"], quantity="acceleration")


def impact_hits() -> ms.Signals:
    z = _arrays("impact_hits", "impacts.npz")
    # the first hit is overloaded
    acc, force = z["acc"][1:, :, None], z["force"][1:, :, None]
    return ms.Signals(outputs=acc, inputs=force, sampling_rate=float(z["fs"]))


def palisaden() -> ms.Signals:
    z = _arrays("palisaden", "palisaden_dec5.npz")
    return ms.Signals(outputs=z["y"], sampling_rate=float(z["fs"]))


def building_3sl() -> ms.Signals:
    z = _arrays("building_3sl", "tsl3.npz")
    return ms.Signals(outputs=z["y"][0], sampling_rate=float(z["fs"]))


def bridge_ssicov() -> ms.Signals:
    z = _arrays("bridge_ssicov", "ssicov.npz")
    return ms.Signals(outputs=z["y"], sampling_rate=float(z["fs"]))


def shear_frame() -> ms.Signals:
    outputs = np.load(measured("shear_frame", "data_shearframe.npy"), allow_pickle=False)
    return ms.Signals(outputs=outputs, sampling_rate=12.0)


def simulated(name: str, seed: int = 0) -> ms.ImpulseResponse:
    return systems.catalog()[name]().impulse_response(600, noise=NOISE, seed=seed)


def truth(name: str) -> tuple[tuple[float, float | None], ...]:
    modes = systems.catalog()[name]().modes()
    kept = np.array(modes.kinds) == "mode"
    return tuple(
        (float(f), 100 * float(z)) for f, z in zip(modes.frequencies[kept], modes.damping_ratios[kept], strict=True)
    )


def _pairs(f: list[float], zeta: list[float]) -> tuple[tuple[float, float | None], ...]:
    return tuple(zip(f, zeta, strict=True))


MEASURED = (
    Case(
        "beam_hammer",
        "measured, impact test of a beam, 7 accelerometers x 6 hits; published values",
        beam_hammer,
        {"band": (100.0, 4500.0)},
        _pairs([177.0, 477.4, 933.1, 1535.5, 2286.9, 3162.4, 4181.2], [0.86, 0.20, 0.15, 0.20, 0.28, 0.18, 0.15]),
    ),
    Case("beam_uff", "measured, beam, 3 FRFs, noisy above 2 kHz; no reference", beam_uff, {"band": (10.0, 2000.0)}),
    Case(
        "hati_gvt",
        "measured, flexible aircraft, one shaker, roving runs; values computed by independent programs",
        hati_gvt,
        {"band": (3.0, 36.0)},
        _pairs([9.175, 9.471, 18.91, 19.12, 32.9], [0.82, 0.77, 0.62, 0.97, 2.9]),
    ),
    Case(
        "impact_hits",
        "measured, four hammer hits, one accelerometer; values computed by independent programs",
        impact_hits,
        {"band": (400.0, 3500.0)},
        _pairs(
            [446.4, 556.4, 730.5, 870.7, 1361.8, 2085.3, 2243.3, 2607.0, 3293.1],
            [1.02, 0.49, 0.49, 0.77, 0.35, 0.82, 0.66, 0.39, 0.14],
        ),
    ),
    Case(
        "palisaden",
        "measured, ambient, 8-storey timber building; published SSI and computed damping",
        palisaden,
        {"band": (0.5, 8.0)},
        _pairs([1.88202, 2.42170, 2.68704], [1.59, 1.46, 1.52]),
    ),
    Case(
        "building_3sl",
        "simulated, ambient, 3-storey building, one set-up; exact values, the samples up to .6 % lower at the top",
        building_3sl,
        {"band": (1.0, 20.0)},
        _pairs(
            [2.63186, 2.69173, 3.43042, 8.29742, 8.42882, 10.6272, 14.0053, 14.093, 17.5741],
            [2.00, 1.97, 1.67, 1.37, 1.38, 1.48, 1.71, 1.72, 2.00],
        ),
    ),
    Case(
        "bridge_ssicov",
        "simulated, ambient, suspension bridge; values in the samples",
        bridge_ssicov,
        {"band": (0.1, 1.5)},
        _pairs([0.2045, 0.3185, 0.4379, 0.5823, 0.8551, 1.1703], [0.5] * 6),
    ),
    Case(
        "shear_frame",
        "simulated, ambient, 5-storey shear frame; values in the samples",
        shear_frame,
        {"band": (0.1, 1.5)},
        _pairs([0.1811, 0.5256, 0.8209, 1.0443, 1.1824], [4.39, 1.50, 0.954, 0.743, 0.651]),
    ),
)

SIMULATED = tuple(
    Case(
        name,
        f"simulated impulse responses at 40 dB: {what}; exact values",
        lambda name=name: simulated(name),
        {},
        truth(name),
        True,
    )
    for name, what in (
        ("chain5", "light damping"),
        ("ring5", "two repeated pairs"),
        ("close4", "two close pairs"),
        ("heavy4", "one mode of 35 %"),
        ("over4", "two real poles"),
    )
)
