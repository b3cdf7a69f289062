"""modred."""

import modred
import numpy as np


def era(data):
    """A of one order by ERA; samples are given twice there, 0 1 1 2 2 3 ..., so that a step of the model is one sample."""
    r, s = int(data["rows"]), int(data["columns"])
    twice = np.repeat(data["values"][: r + s], 2, axis=0)[1:-1]
    return modred.ERA(verbosity=0).compute_model(twice, int(data["order"]), mc=s, mo=r)[0]


def markov(data):
    """A by OKID and ERA; the direct term comes first. Two samples a block, which is how it reads a plain sequence."""
    found = modred.OKID(data["inputs"].T.copy(), data["outputs"].T.copy(), int(data["samples"]))
    return modred.ERA(verbosity=0).compute_model(found[1:], int(data["order"]))[0]
