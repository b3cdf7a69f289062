"""Where large products are computed: NumPy, or PyTorch on the processor or a graphics card. Small eigenproblems stay with NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft

from modalscope.model.checks import Array, check_choice
from modalscope.model.errors import DataError
from modalscope.model.extras import optional_package

__all__ = ["DEVICES", "Device", "device_named", "fetched", "namespace", "transforms"]

#: What may be asked for: PyTorch on the processor, or on a graphics card.
DEVICES = ("cpu", "cuda")


@dataclass(frozen=True, eq=False, slots=True)
class Device:
    """A place for arrays of PyTorch.

    Parameters
    ----------
    name : str
        As PyTorch has it.
    torch : module
    """

    name: str
    torch: Any

    def place(self, array: Any) -> Any:
        """Return an array there: a copy, unless it is there already."""
        if isinstance(array, np.ndarray):
            return self.torch.tensor(np.ascontiguousarray(array), device=self.name)
        return array


def device_named(name: str | None) -> Device | None:
    """Return the place that is asked for; None is NumPy.

    Parameters
    ----------
    name : {"cpu", "cuda"}, optional

    Raises
    ------
    DataError
        PyTorch is not installed, or has no graphics card.
    """
    if name is None:
        return None
    check_choice("device", name, DEVICES)
    torch = optional_package(f"device={name!r}", "torch", "torch")
    optional_package(f"device={name!r}", "array_api_compat", "torch")
    if name == "cuda" and not torch.cuda.is_available():
        raise DataError(
            "device='cuda' was asked", "PyTorch finds no graphics card here", "Use device='cpu', or leave it out."
        )
    return Device(name, torch)


def namespace(array: Any) -> Any:
    """Return the functions that belong to an array, as the array API has them.

    Parameters
    ----------
    array : array or tensor

    Examples
    --------
    >>> namespace(np.zeros(3)) is np
    True
    """
    if isinstance(array, np.ndarray):
        return np
    return optional_package("an array of PyTorch", "array_api_compat", "torch").array_namespace(array)


def transforms(array: Any) -> Any:
    """Return the Fourier transforms that belong to an array.

    Parameters
    ----------
    array : array or tensor
    """
    return scipy.fft if isinstance(array, np.ndarray) else namespace(array).fft


def fetched(array: Any) -> Array:
    """Return an array of NumPy, from wherever it is.

    Parameters
    ----------
    array : array or tensor
    """
    return array if isinstance(array, np.ndarray) else np.asarray(array.cpu().numpy())
