"""python-control: ERA of impulse responses, the order given by a person, twice the number of modes."""

import numpy as np

REQUIRES = ("control==0.10.2",)
TAKES = ("impulses", "decay")
SOURCE = (
    "python-control, docstring of eigensys_realization: eigensys_realization(YY, r), Hankel matrix of 2 r by 2 r blocks"
)
VARIANTS = {"python-control": "ERA of given order"}


def run(test, variant):
    """Realize."""
    import control
    from child import modes_of

    order, rate = 2 * test.human("modes"), test.sampling_rate
    if test.kind == "impulses":
        values = test.values.transpose(1, 2, 0)
    else:
        y, rate = test.slower(test.outputs)
        values = np.concatenate([np.zeros((y.shape[1], 1)), y.T], axis=1)[:, None]  # its first sample is D
    found, _ = control.eigensys_realization(values, order)
    return modes_of(found.A, found.C, rate)
