"""Arrays that hold their own axis, as analysers save them: the averaged responses are read, the other sets named and read on demand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

import modalscope as ms
from modalscope.io import survey

_RNG = np.random.default_rng(0)
F = 0.25 * np.arange(1, 301)
T = np.arange(2000) / 256
H = {
    k: 1 / (1 - (F / 12) ** 2 + 0.04j * F / 12) + c / (1 - (F / 31) ** 2 + 0.03j * F / 31)
    for k, c in ((2, 0.3), (3, -0.5))
}
X = {k: _RNG.standard_normal(T.size) for k in (1, 2, 3)}


def _arrays(response: str = "H1_{}", coherence: str = "C1_{}", record: str = "X{}") -> dict[str, Any]:
    held: dict[str, Any] = {record.format(k): np.stack([T, x], 1) for k, x in X.items()}
    held |= {"S1": np.stack([F, H[2] * H[3]], 1)}
    for k, values in H.items():
        held |= {f"G{k}_{k}": np.stack([F, np.abs(values) ** 2], 1), response.format(k): np.stack([F, values], 1)}
        held |= {coherence.format(k): np.stack([F, 0.9 + 0.05 * _RNG.random(F.size)], 1)}
    return held | {"Unit": np.array(["N", "g", "g"], object), "ChanNum": np.arange(1.0, 4.0)}


@pytest.mark.parametrize("names", [("H1_{}", "C1_{}", "X{}"), ("FRF_1_{}", "Coh_1_{}", "Time_{}")])
@pytest.mark.parametrize("turned", [False, True])
def test_responses_go_before_the_records_beside_them(names: tuple[str, str, str], turned: bool, tmp_path: Path) -> None:
    arrays = {k: v.T if turned and v.ndim == 2 else v for k, v in _arrays(*names).items()}
    savemat(tmp_path / "a.mat", arrays)
    found = ms.read(tmp_path / "a.mat")
    assert (found.output_dofs, found.input_dofs, found.units) == (("2", "3"), ("1",), (("g", "g"), ("N",)))
    np.testing.assert_allclose(found.values[:, :, 0], np.stack([H[2], H[3]], 1))
    np.testing.assert_array_equal(found.frequencies, F)
    assert found.coherence is not None
    note = " ".join(survey(tmp_path / "a.mat").notes)
    record = names[2].format("").rstrip("_")
    assert f"{record} (" in note
    assert f"To take one: --test {record}" in note


def test_one_option_takes_another_set(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", _arrays())
    record = ms.read(tmp_path / "a.mat", sheet="X")
    assert (record.output_dofs, record.input_dofs, record.sampling_rate) == (("2", "3"), ("1",), 256.0)
    np.testing.assert_array_equal(record.outputs, np.stack([X[2], X[3]], 1))
    with pytest.raises(ms.DataError, match="sets of arrays are X, S, G, H, C"):
        ms.read(tmp_path / "a.mat", sheet="Q")


def test_records_that_hold_their_times_are_one_record(tmp_path: Path) -> None:
    savemat(
        tmp_path / "a.mat",
        {f"ch{k}": np.stack([T, x], 1) for k, x in X.items()} | {"Unit": np.array(["N", "g", "g"], object)},
    )
    found = ms.read(tmp_path / "a.mat")
    assert (found.output_dofs, found.input_dofs, found.sampling_rate) == (("2", "3"), ("1",), 256.0)
