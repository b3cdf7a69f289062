"""Compute operating deflection shapes: the measured motion of a structure at a frequency, of all modes together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, check_each, check_positive
from modalscope.numerics.errors import DataError
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.singular_spectra import decomposition


@named(data=(Signals, FrequencyResponse, ImpulseResponse))
def ods(
    data: Signals | FrequencyResponse | ImpulseResponse,
    frequency: float | Iterable[float],
    *,
    input: str | int | None = None,
) -> ModalModel:
    """Compute the operating deflection shapes at one or more frequencies: the measured motion, of all modes together.

    Of responses it is the column of one input at the nearest line, or of several inputs the first singular vector of the matrix of
    responses times its singular value. Of records without inputs it is the first singular vector of their cross spectra.

    Parameters
    ----------
    data : Signals, FrequencyResponse or ImpulseResponse
    frequency : float or iterable of float
        Hz; the nearest lines are taken.
    input : str or int, optional
        One input, by its label or from zero; by default all.

    Returns
    -------
    ModalModel
        Undamped, at the frequencies of the lines, to be drawn and animated as modes are: `plot.shape`, `plot.animate`.

    Raises
    ------
    DataError
        A frequency outside of the data, an input that is not there, or records from which no response can be estimated.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> chain = chain5()
    >>> shapes = ods(chain.frequency_response(np.linspace(0.1, 8, 80)), 0.9)
    >>> print(shapes[0])
    0.9000 Hz, 0.000 %
    """
    several = np.iterable(frequency) and not isinstance(frequency, str)
    wanted: Any = check_each("frequency", frequency, "numbers in Hz") if several else [frequency]
    asked = [check_positive("frequency", f) for f in wanted]
    lines, shapes = _on_lines(data, input)
    span = (float(lines[0]), float(lines[-1]))
    outside = [f for f in asked if not span[0] <= f <= span[1]]
    if outside or not asked:
        asked_for = f"deflection shapes at {', '.join(f'{f:g}' for f in asked) or 'no frequency'} Hz were asked"
        raise DataError(asked_for, f"the data go from {span[0]:g} to {span[1]:g} Hz", "Ask for frequencies in between.")
    index = np.array([int(np.argmin(np.abs(lines - f))) for f in asked])
    text = "Operating deflection shapes, not modes: the motion of all modes at a frequency"
    labels = {name: value for name, value in data.labelled().items() if name in ("output_dofs", "geometry")}
    return ModalModel(
        poles=2j * np.pi * lines[index],
        shapes=np.array([shapes(k) for k in index]).T,
        scaling="as measured",
        notes=(Note("deflection shapes", {}, text),),
        **labels,
    )


def _on_lines(data: Any, input: str | int | None) -> tuple[Array, Any]:
    """Return the lines, and a function of the shape (l,) on one of them."""
    if isinstance(data, Signals):
        if data.inputs is None:
            if input is not None:
                raise DataError(f"input {input!r} was asked", "the records have no inputs", "Leave input out.")
            fdd = decomposition(data)
            return fdd.frequencies, lambda k: fdd.vectors[k, :, 0] * np.sqrt(fdd.singular_values[k, 0])
        data = estimate_frf(data)
    lines, H = data.spectrum()
    if input is not None:
        column = _column(data.columns, input)
        return lines, lambda k: H[k, :, column]
    if H.shape[2] == 1:
        return lines, lambda k: H[k, :, 0]
    return lines, lambda k: _first(H[k])


def _first(H: ComplexArray) -> ComplexArray:
    """Return the first left singular vector times its singular value."""
    U, s, _ = np.linalg.svd(H, full_matrices=False)
    return np.asarray(U[:, 0] * s[0])


def _column(columns: Any, input: str | int) -> int:
    listed = list(map(str, columns))
    if isinstance(input, int) and not isinstance(input, bool) and 0 <= input < len(listed):
        return input
    if isinstance(input, str) and input in listed:
        return listed.index(input)
    raise DataError(f"input {input!r} was asked", f"there are {', '.join(listed)}", "Name one, or count from zero.")
