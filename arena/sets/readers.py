"""How sets are read: functions of paths and of the options in the set's file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh

import modalscope as ms
from arena.bounds import of_ambient, of_response
from modalscope.systems import Structure
from modalscope.systems.listing import trial


def files(paths: list[Path], **reading: Any) -> Any:
    """Return the files as `modalscope.read` reads them; several are parts of one test."""
    parts = [ms.read(path, **reading) for path in paths]
    return parts[0] if len(parts) == 1 else ms.merge(parts)


def arrays(
    paths: list[Path],
    *,
    outputs: str,
    inputs: str | None = None,
    rate: Any = "fs",
    first: int = 0,
    part: int | None = None,
) -> ms.Signals:
    """Return a record of the arrays of a file: (samples, channels), or (runs, samples, channels) from the run `first` on, or one `part`."""
    held = np.load(paths[0])
    named = {"": held} if isinstance(held, np.ndarray) else held
    taken = slice(first, None) if part is None else part
    y, u = (None if name is None else np.asarray(named[name])[taken] for name in (outputs, inputs))
    if u is not None and u.ndim == 1 + bool(first):  # one channel each
        y, u = y[..., None], u[..., None]
    return ms.Signals(outputs=y, inputs=u, sampling_rate=float(named[rate]) if isinstance(rate, str) else float(rate))


def responses(paths: list[Path], *, values: str, frequencies: str, quantity: str) -> ms.FrequencyResponse:
    """Return frequency responses (lines, outputs[, inputs]) of the arrays of a file."""
    with np.load(paths[0]) as held:
        H = held[values]
        H = H[:, :, None] if H.ndim == 2 else H
        return ms.FrequencyResponse(values=H, frequencies=held[frequencies], quantity=quantity)


def stepped(paths: list[Path], *, omega: str, damping: str, shapes: str, rate: float, **options: Any) -> Any:
    """Return a record that Newmark's average acceleration integrated at its own step, and the modes that its samples have.

    f' = (rate / pi) atan(pi f / rate); damping ratios and shapes stay.
    """
    record = arrays(paths[:1], rate=rate, **options)
    held = dict(np.load(paths[0])) if paths[0].suffix == ".npz" else {p.stem: np.load(p) for p in paths[1:]}
    f = np.ravel(held[omega]) / (2 * np.pi)
    zeta, n = np.resize(np.ravel(held[damping]), f.size), record.outputs.shape[1]
    phi = held[shapes]
    if phi.shape[0] != n:  # rows are modes on a grid: where the sensors are
        places = [int(np.argmin(abs(np.ravel(held["ygrid"]) - x))) for x in np.ravel(held["pos"])]
        phi = phi[:, places].T
    f = rate / np.pi * np.arctan(np.pi * f / rate)
    poles = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    return record, ms.ModalModel(poles=poles, shapes=phi[:, : f.size].astype(complex))


def setups(paths: list[Path], *, outputs: str, rate: str, common: int) -> ms.Setups:
    """Return the setups of a file (setups, samples, channels), whose first channels are common."""
    with np.load(paths[0]) as held:
        runs, fs = held[outputs], float(held[rate])
    shared = [f"r{j}" for j in range(common)]
    labels = [[*shared, *(f"{k}.{j}" for j in range(common, run.shape[1]))] for k, run in enumerate(runs)]
    each = zip(runs, labels, strict=True)
    return ms.Setups(parts=[ms.Signals(outputs=run, sampling_rate=fs, output_dofs=own) for run, own in each])


def structure(paths: list[Path], *, system: str, test: str, **options: Any) -> Any:
    """Return a simulated test of a structure of the catalog, with nothing but noise wrong, and its modes: `modalscope.systems.trial`."""
    built = ms.systems.build(system)
    data = trial(built, test, **options)
    return data, _at(built, data), of_response(built, data, trial(built, test, **options | {"snr_db": None}))


def chain(
    paths: list[Path],
    *,
    seed: int,
    test: str,
    masses: tuple[int, int] = (4, 7),
    pair: float = 0.0,
    noise: float = 0.1,
    forces: int = 1,
) -> Any:
    """Return a test of a random chain and its modes: masses of .7 to 1.3 kg, springs that scatter by .3, damping of .5 to 2 %.

    `pair`: beside it stands a second one, stiffer by twice this part, which a weak spring ties to it at every mass. Records last 600
    periods of the first mode, at 2.2 to 5 times the highest frequency; forces act on the first masses. `noise`: a part of each RMS.
    """
    rng = np.random.default_rng([69, seed])
    n = int(rng.integers(masses[0], masses[1] + 1))
    plain = ms.systems.chain(rng.uniform(0.7, 1.3, n), 400 * rng.lognormal(0, 0.3, n))
    M, K = np.array(plain.mass), np.array(plain.stiffness)
    if pair:
        link = 1e-3 * np.diag(K).mean() * np.eye(n)
        M, K = np.kron(np.eye(2), M), np.block([[K + link, -link], [-link, K * (1 + 2 * pair) + link]])
    w2, phi = eigh(K, M)
    D = M @ phi @ np.diag(2 * rng.uniform(0.005, 0.02, w2.size) * np.sqrt(w2)) @ phi.T @ M
    built = Structure(mass=M, stiffness=K, damping=D, inputs=range(forces))
    f = built.modes().frequencies
    if test in ("frf", "impulse"):
        data = trial(built, test, snr_db=-20 * np.log10(noise), seed=seed)
        return data, _at(built, data), of_response(built, data, trial(built, test))
    rate = float(rng.uniform(2.2, 5)) * f[-1]
    data = built.simulate(inputs=test, duration=600 / f[0], sampling_rate=rate, noise=noise, seed=seed)
    return data, _at(built, data), of_ambient(built, data, noise) if test == "ambient" else None


def decay(paths: list[Path], *, system: str, noise: float, samples: int, seed: int, rate: float) -> Any:
    """Return the free decay of a structure from an impulse on its first input, and its modes."""
    built = ms.systems.build(system)
    asked: dict[str, Any] = {"sampling_rate": rate, "quantity": "velocity"}
    noisy, clean = (built.impulse_response(samples, noise=x, seed=seed, **asked) for x in (noise, None))
    one = (each.select(inputs=[0]) for each in (noisy, clean))
    known = of_response(
        built, *(replace(each, values=each.values[1:], first_sample=each.first_sample + 1) for each in one)
    )
    record = ms.Signals(outputs=noisy.values[1:, :, 0], sampling_rate=rate, output_dofs=noisy.output_dofs)
    return record, _at(built, noisy), known


def scanned(paths: list[Path], *, points: int, modes: int, lines: int, noise: float, seed: int) -> Any:
    """Return velocities of a clamped beam at all points, as a laser scans them under one shaker, and the modes, which fill the band."""
    built = ms.systems.clamped_beam(points)
    f = built.modes().frequencies
    grid, at = np.linspace(f[0] / 4, np.sqrt(f[modes - 1] * f[modes]), lines), [2 * (points // 3)]
    data = built.frequency_response(grid, inputs=at, quantity="velocity", noise=noise, seed=seed)
    known = _at(built, data)
    return data, ms.ModalModel(poles=known.poles[:modes], shapes=known.shapes[:, :modes], output_dofs=data.output_dofs)


def history(paths: list[Path]) -> Any:
    """Return the modes of many records, as another program wrote them."""
    return ms.monitoring.read_history(paths[0])


def tower(paths: list[Path], *, seed: int, floors: int, common: int, moving: int, parts: int, noise: float) -> Any:
    """Return ambient setups of a chain fixed at its foot: `common` sensors stay, `moving` ones go up, and the modes."""
    rng = np.random.default_rng([69, seed])
    built = ms.systems.chain(np.ones(floors), np.full(floors, 1e4), damping_ratios=rng.uniform(0.008, 0.02, floors))
    f, stay = built.modes().frequencies, list(range(floors - common, floors))
    free = [k for k in range(floors) if k not in stay]
    runs = [stay + free[p * moving : (p + 1) * moving] for p in range(parts)]
    wind: dict[str, Any] = {"inputs": "ambient", "duration": 400 / f[0], "sampling_rate": 2.6 * f[-1], "noise": noise}
    test = ms.Setups(parts=[built.simulate(outputs=run, seed=1000 * seed + k, **wind) for k, run in enumerate(runs)])
    return test, _at(built, test)


def _at(built: Structure, data: Any) -> ms.ModalModel:
    """Return the modes of a structure on the outputs of a test."""
    modes = built.modes()
    rows = [modes.output_dofs.index(dof) for dof in data.output_dofs]
    return ms.ModalModel(poles=modes.poles, shapes=modes.shapes[rows], output_dofs=data.output_dofs)
