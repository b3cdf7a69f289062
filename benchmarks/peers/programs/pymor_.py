"""pyMOR; its matrix A comes from the shift of the left factor, by least squares."""

import numpy as np
from pymor.core.logger import set_log_levels
from pymor.reductors.era import ERAReductor, RandomizedERAReductor

set_log_levels({"pymor": "ERROR"})


def _samples(data):
    return np.ascontiguousarray(data["values"][: 2 * int(data["rows"]) - 1])


def era(data):
    """A of one order by the whole decomposition."""
    model = ERAReductor(_samples(data), 1.0, force_stability=False).reduce(int(data["order"]))
    return model.A.matrix


def era_randomized(data):
    """A of one order by a randomized decomposition with two power iterations."""
    model = RandomizedERAReductor(_samples(data), 1.0, force_stability=False).reduce(int(data["order"]))
    return model.A.matrix
