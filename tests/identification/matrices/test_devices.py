"""Products by PyTorch are those by NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import LargeMatrix
from modalscope.numerics.resources import device_named
from modalscope.numerics.sums import TriangleSum
from modalscope.signals.preprocess.stored_correlation import LagSum
from tests.support import relative


def here(name: str) -> str:
    pytest.importorskip("torch", reason="PyTorch is not installed: make torch")
    try:
        device_named(name)
    except DataError as error:
        pytest.skip(error.found)
    return name


def computed(rng: Any) -> dict[str, Any]:
    """Return what all kernels give."""
    y, run = rng.standard_normal((61, 5, 2)), rng.standard_normal((3000, 4))
    wide = BlockHankel(rng.standard_normal((40, 2, 5)), 6, 20)
    H, total, lags = BlockHankel(y, 30, 30, first=1), TriangleSum(4), LagSum(4, [0, 2], 20)
    total.add(run)
    lags.add(run)
    short = BlockHankel(y, 2, 50)
    left, right = rng.standard_normal((150, 3)), rng.standard_normal((60, 3))
    whole = LargeMatrix(rng.standard_normal((50, 20)))
    return {
        "gram": H.gram(),
        "gram of many inputs": wide.gram(),
        "product": H.times(right),
        "transposed product": H.transposed_times(left),
        "product by rows": short.times(rng.standard_normal((100, 2))),
        "transposed product by rows": short.transposed_times(rng.standard_normal((10, 2))),
        "triangle": np.abs(total.finish()),
        "lags": lags.finish(),
        "array": whole.times(rng.standard_normal((20, 2))),
        "gram of an array": whole.gram(),
    }


@pytest.mark.parametrize("name", ["cpu", "cuda"])
def test_every_kernel_gives_the_same_on_a_device(name: str) -> None:
    expected = computed(np.random.default_rng(0))
    with ms.working(device=here(name)):
        found = computed(np.random.default_rng(0))
    for kernel, value in expected.items():
        assert isinstance(found[kernel], np.ndarray), kernel
        assert relative(found[kernel], value) < 1e-12, kernel


@pytest.mark.parametrize("name", ["cpu", "cuda"])
@pytest.mark.parametrize("factorization", ["gram", "randomized", "dense"])
def test_modes_are_the_same_on_a_device(name: str, factorization: str) -> None:
    response = ms.systems.add_noise(ms.systems.chain5().state_space(dt=0.05).impulse_response(300), 0.01, 0)
    options: dict[str, Any] = {"order": 10, "factorization": factorization, "block_rows": 60, "block_columns": 200}
    expected = ms.identify(response, **options)
    with ms.working(device=here(name)):
        found = ms.identify(response, **options)
    assert relative(found.poles, expected.poles) < 1e-9
    assert abs(found.fit_error - expected.fit_error) < 1e-9


def test_a_device_that_is_not_there_is_said() -> None:
    with pytest.raises(DataError, match="device"), ms.working(device="tpu"):
        pass
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: make torch")
    if not torch.cuda.is_available():
        with pytest.raises(DataError, match="no graphics card"), ms.working(device="cuda"):
            pass
