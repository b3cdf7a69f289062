"""pyyeti: ERA with its automatic choice, of impulse responses and decays; of ambient records by its NExT first."""

import numpy as np

REQUIRES = ("pyyeti==1.4.7",)
TAKES = ("impulses", "decay", "ambient")
SOURCE = "pyyeti 1.4.7, docstrings of era.ERA and era.NExT: ERA(..., auto=True); lag_stop = rate / lowest frequency"
VARIANTS = {"pyyeti": "ERA, automatic choice"}

#: Samples of a decay that its Hankel matrix is made of: its SVD computes the square left factor.
MOST = 2000


def run(test, variant):
    """Run ERA."""
    from pyyeti import era

    rate = test.sampling_rate
    if test.kind == "impulses":
        values = test.values.transpose(1, 0, 2)
    else:
        y, rate = test.slower(test.outputs)
        values = y.T
        if test.kind == "ambient":
            values = era.NExT(values, rate, lag_stop=round(rate / test.human("lowest frequency")))
    try:
        found = era.ERA(np.ascontiguousarray(values[:, :MOST]), sr=rate, auto=True, verbose=False, show_plot=False)
    except RuntimeError as error:
        if "No modes selected" in str(error):
            return {"frequencies": [], "damping_ratios": []}
        raise
    return {"frequencies": found.freqs_hz, "damping_ratios": found.zeta, "shapes": found.phi}
