"""sdypy-EMA."""

import warnings

from sdypy import EMA


def lscf(data):
    """Poles of every degree; those of the highest."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        f = data["frequencies"]
        model = EMA.Model(
            data["values"][:, :, 0].T.copy(), f, lower=f[0], upper=f[-1], pol_order_high=int(data["degree"])
        )
        model.get_poles(method="lscf", show_progress=False)
    return model.all_poles[-1]
