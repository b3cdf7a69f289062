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
    from scipy.signal import decimate

    order, rate = 2 * test.human("modes"), test.sampling_rate
    if test.kind == "impulses":
        values = test.values.transpose(1, 2, 0)
    else:
        y = test.outputs
        if (q := test.human("decimation")) > 1:
            y, rate = decimate(y, q, axis=0, ftype="fir"), rate / q
        values = np.concatenate([np.zeros((y.shape[1], 1)), y.T], axis=1)[:, None]  # its first sample is D
    found, _ = control.eigensys_realization(values, order)
    z, vectors = np.linalg.eig(found.A)
    kept = z.imag > 0
    s = np.log(z[kept]) * rate
    return {
        "frequencies": abs(s) / 2 / np.pi,
        "damping_ratios": -s.real / abs(s),
        "shapes": (found.C @ vectors)[:, kept],
    }
