"""pyyeti; with indicators, as it always does."""

import warnings

from pyyeti.era import ERA


def era(data):
    """A of one order by ERA."""
    r, s = int(data["rows"]), int(data["columns"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = ERA(
            data["values"][: r + s].transpose(1, 0, 2).copy(),
            1.0,
            svd_tol=int(data["order"]),
            auto=True,
            alpha=r,
            beta=s,
            verbose=False,
            show_plot=False,
        )
    return found.A_hat
