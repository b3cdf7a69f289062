"""python-control."""

import control
import numpy as np


def era(data):
    """A of one order by ERA; the direct term comes first there."""
    Y = np.concatenate([np.zeros((1, *data["values"].shape[1:])), data["values"]]).transpose(1, 2, 0)
    model, _ = control.eigensys_realization(Y, int(data["order"]), m=int(data["rows"]), n=int(data["columns"]))
    return model.A
