"""Isolate modes by appropriated force patterns (tuned sine dwell, phase resonance), and fit each isolated response.

The oldest method of the field, by computation instead of by shakers: a quick estimate, and an independent check of the other methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from modalscope.data.indicators import mmif, mpc
from modalscope.data.modes import ModalModel
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.responses import FrequencyResponse
from modalscope.data.sameness import log_ratios
from modalscope.numerics.arguments import POSITIVE, named
from modalscope.numerics.checks import ComplexArray, RealArray, check_band, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import QUANTITIES, poles_from
from modalscope.numerics.plugins import READINGS, added

#: Minimum number of lines on either side of a minimum for the single-mode fit.
_MIN_LINES = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Dwell:
    """Result of a tuned sine dwell.

    Parameters
    ----------
    modes : ModalModel
        Frequencies, damping and real shapes; the indicator "mmif" is 0 for a mode that is isolated perfectly.
    forces : array, (n, m)
        Appropriated force patterns as rows, of length one.
    indicator : array, (F, m)
        The mode indicator function, smallest first.
    frequencies : array, (F,)
        Its lines, Hz.
    levels : record array, (R,), optional
        Of dwell records, by rising amplitude: `amplitude` of the largest output, `frequency` (Hz) and `damping` (ratio) there, the
        backbone.
    """

    modes: ModalModel
    forces: RealArray
    indicator: RealArray
    frequencies: RealArray
    levels: Any = None


@named(threshold=POSITIVE)
def tuned_dwell(
    response: FrequencyResponse | Records | Signals | list[Signals],
    *,
    band: tuple[float, float] | None = None,
    threshold: float = 0.5,
) -> Dwell:
    """Isolate one mode at a time by its force pattern and read frequency, damping and shape off the isolated response.

    At a minimum of the mode indicator function the pattern f is applied to all lines, y = H f. The quadrature part at the minimum is the
    shape; y seen along it is the response of one mode, and within the half height of its quadrature peak
    (w0^2 - w^2 + 2 j zeta w0 w) q = a + c w^2 is fitted, c the rest of the structure.

    Parameters
    ----------
    response : FrequencyResponse, Records, or a list of Signals
        With a known quantity; more inputs isolate close modes better. Of records each run is a dwell: one frequency, forces that excite
        one mode, its second half steady, and motion measured at each force. `levels` then holds frequency and damping against
        amplitude, `modes` the mode at the lowest level; `indicator` is the share of the motion in phase with the force in each run.
    band : (float, float), optional
        Hz; of responses.
    threshold : float
        Minima of the indicator above this are not modes; of responses.

    Raises
    ------
    DataError
        An unknown quantity, a band without lines, fewer lines than a minimum needs; fewer than four dwells, or too short ones.

    Examples
    --------
    >>> import numpy as np
    >>> from modalscope.systems import chain5
    >>> found = tuned_dwell(chain5().frequency_response(np.linspace(0.3, 7, 3000)))
    >>> found.modes.frequencies.round(2)
    array([0.91, 2.64, 4.17, 5.36, 6.11])
    """
    if not isinstance(response, list | tuple):
        check_kind("tuned_dwell", response, (FrequencyResponse, Signals, Records))
    if not hasattr(response, "lines"):
        return Dwell(**added(READINGS, "dwells")(as_records(cast("Records | Signals", response))))
    lines = cast("FrequencyResponse", response)
    cut = lines if band is None else lines.band(*check_band(band))
    least = 2 * _MIN_LINES + 1
    if cut.lines < least:
        raise DataError(f"a tuned dwell needs at least {least} lines", f"there are {cut.lines}", "Widen the band.")
    curves, forces = mmif(cut)
    inner = curves[1:-1]
    minima = (inner <= curves[:-2]) & (inner < curves[2:]) & (inner < threshold)
    modes = [
        mode
        for c in range(curves.shape[1])
        for k in np.flatnonzero(minima[:, c]) + 1
        if (mode := _isolated(cut, int(k), forces[k, :, c], float(curves[k, c]))) is not None
    ]
    modes = _without_doubles(sorted(modes, key=lambda mode: mode.value))
    modes.sort(key=lambda mode: abs(mode.pole))
    return Dwell(
        modes=_modal_model(cut, modes),
        forces=np.array([mode.force for mode in modes]).reshape(len(modes), cut.values.shape[2]),
        indicator=curves,
        frequencies=cut.frequencies,
    )


class _Isolated(NamedTuple):
    pole: complex
    shape: RealArray
    force: RealArray
    value: float


def _isolated(response: FrequencyResponse, line: int, force: RealArray, value: float) -> _Isolated | None:
    """Return the mode at a minimum, or None where the isolated response is no resonance."""
    w = 2 * np.pi * response.frequencies
    power = QUANTITIES[response.quantity or ""]
    with np.errstate(divide="ignore", invalid="ignore"):
        y = (response.values @ force) / ((1j * w) ** power)[:, None]
    shape = y[line].imag
    size = np.linalg.norm(shape)
    if not size > 0:
        return None
    shape = shape / size
    q = y @ shape
    # the half height of the quadrature peak, one run of lines
    high = np.abs(q.imag) >= abs(q.imag[line]) / 2
    low_end, high_end = line, line
    while low_end > 0 and high[low_end - 1]:
        low_end -= 1
    while high_end < w.size - 1 and high[high_end + 1]:
        high_end += 1
    lines = np.arange(max(min(low_end, line - _MIN_LINES), 0), min(max(high_end, line + _MIN_LINES) + 1, w.size))
    lines = lines[w[lines] > 0]
    pole = _one_mode(w[lines] / w[line], q[lines] / abs(q[line]))
    return None if pole is None else _Isolated(pole * w[line], shape, force, value)


def _one_mode(w: RealArray, q: ComplexArray) -> complex | None:
    """Fit w0^2 q + 2 zeta w0 (j w q) - a - c w^2 = w^2 q, with complex a and c, and return the pole."""
    zero, one = np.zeros_like(w), np.ones_like(w)
    real = np.column_stack([q.real, (1j * w * q).real, -one, zero, -(w**2), zero])
    imaginary = np.column_stack([q.imag, (1j * w * q).imag, zero, -one, zero, -(w**2)])
    target = w**2 * q
    solution = np.linalg.lstsq(np.vstack([real, imaginary]), np.concatenate([target.real, target.imag]), rcond=None)[0]
    stiffness, damping = float(solution[0]), float(solution[1])
    if stiffness <= 0 or not 0 < damping < 2 * np.sqrt(stiffness):
        return None
    w0 = np.sqrt(stiffness)
    return complex(poles_from([w0 / (2 * np.pi)], [damping / (2 * w0)])[0])


def _without_doubles(modes: list[_Isolated]) -> list[_Isolated]:
    """Keep the best isolated one of each mode."""
    if not modes:
        return []
    shapes = np.array([mode.shape for mode in modes]).T
    model = ModalModel(poles=np.array([mode.pole for mode in modes], dtype=complex), shapes=shapes.astype(complex))
    same, kept = log_ratios(model, model) > 0, list[int]()
    for k in range(len(modes)):
        if not same[k, kept].any():
            kept.append(k)
    return [modes[k] for k in kept]


def _modal_model(response: FrequencyResponse, modes: list[_Isolated]) -> ModalModel:
    shapes = np.array([mode.shape for mode in modes]).reshape(len(modes), response.values.shape[1]).T
    return ModalModel(
        poles=np.array([mode.pole + response.added_damping for mode in modes], dtype=complex),
        shapes=shapes,
        quantity=response.quantity,
        indicators={"mmif": np.array([mode.value for mode in modes]), "mpc": mpc(shapes)},
        output_dofs=response.output_dofs,
        units=(response.units[0], ()),
        geometry=response.geometry,
        processing=(*response.processing, "tuned sine dwell with appropriated forces"),
        source_path=response.source_path,
        scaling="length 1",
    )
