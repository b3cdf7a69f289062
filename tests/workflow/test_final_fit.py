"""What is reported of refined modes, shapes and participation, is the best that the poles allow, of data of many kinds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.modes import ModalModel
from modalscope.data.response import Response
from modalscope.numerics.checks import RealArray
from tests.judging.hard import frequency_response, impulse_response, random_structure
from tests.support import measured

Case = tuple[Response, ModalModel]


def analysed(data: object, **options: object) -> Case:
    result = ms.analyze(data, **options)
    return result.diagram.response, result.modes


def beam() -> ms.FrequencyResponse:
    stored = np.load(measured("beam_hammer", "beam_mimo_frf.npz"))
    return ms.FrequencyResponse(
        values=stored["H"].transpose(2, 1, 0), frequencies=stored["freq"], quantity="acceleration"
    )


CASES: dict[str, Callable[[], Case]] = {
    "responses": lambda: analysed(frequency_response(random_structure(3), 30, 3)[0]),
    "more responses": lambda: analysed(frequency_response(random_structure(4), 20, 4)[0]),
    "impulse responses": lambda: analysed(impulse_response(random_structure(5), 30, 5)[0]),
    "more impulse responses": lambda: analysed(impulse_response(random_structure(6), 20, 6)[0]),
    "responses of 40 dB": lambda: analysed(frequency_response(random_structure(7), 40, 7)[0]),
    "beam exchanged": lambda: analysed(beam(), band=(800, 1200)),
    "beam, higher": lambda: analysed(beam(), band=(2000, 2600)),
    "universal file": lambda: analysed(ms.read(measured("beam_uff", "beam_2kHz.uff")), band=(10, 400)),
    "ruler": lambda: analysed(str(sorted(measured("ruler_mat").glob("*.mat"))[0]), band=(5, 300)),
    "logger": lambda: analysed(str(measured("kyowa_frame", "imp_ham_set2_nomass.CSV"))),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_misfit_is_that_of_plain_least_squares_on_the_same_poles(name: str) -> None:
    response, modes = CASES[name]()
    assert modes.participation is not None
    reported, least = alternated(response, modes)
    assert reported == pytest.approx(least, rel=1e-6)
    assert reported < 0.7 * np.linalg.norm(response.whole_basis(modes.poles).data)


def alternated(response: Response, modes: ModalModel) -> tuple[float, float]:
    """Return the misfit of modes, and that after shapes and participation were fitted in turns by dense least squares until it stays."""
    basis = response.whole_basis(modes.poles - response.added_damping, response.outside_powers)
    rows, outputs, inputs = basis.data.shape
    Q = np.linalg.qr(basis.terms)[0]
    g, data = (x - Q @ (Q.T @ x) for x in (basis.functions, basis.data.reshape(rows, -1)))
    data = data.reshape(rows, outputs, inputs)
    sides = [modes.shapes.T, np.asarray(modes.participation)]
    turned = [data.transpose(0, 2, 1), data]  # the side that is fitted last

    def columns(known: RealArray) -> RealArray:
        real, imaginary = g[:, None, ::2], g[:, None, 1::2]
        both = [real * known.real.T + imaginary * known.imag.T, imaginary * known.real.T - real * known.imag.T]
        return np.stack(both, axis=-1).reshape(rows * known.shape[1], -1)

    def left(known: RealArray, unknown: RealArray, target: RealArray) -> float:
        flat = np.stack([unknown.real, unknown.imag], axis=1).reshape(-1, unknown.shape[1])
        return float(np.linalg.norm(columns(known) @ flat - target.reshape(-1, unknown.shape[1])))

    reported = least = left(sides[0], sides[1], turned[1])
    for _ in range(200):
        for k in (0, 1):
            A = columns(sides[1 - k])
            x = np.linalg.lstsq(A, turned[k].reshape(len(A), -1), rcond=None)[0]
            sides[k] = x[::2] + 1j * x[1::2]
        before, least = least, left(sides[0], sides[1], turned[1])
        if before - least < 1e-9 * before:
            break
    return reported, least
