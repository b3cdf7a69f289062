"""pyOMA2: SSI-cov, its poles grouped by each automatic preset that is named after a paper or an algorithm, or picked by a person."""

import logging

import numpy as np

REQUIRES = ("pyoma_2==1.4.3",)
TAKES = ("ambient",)
SOURCE = (
    "pyOMA2 1.4.3, Example5 - Clustering: decimation, SSI(br=30, ordmax=100, step=2, method='cov'), Clustering(quick=...); "
    "by hand Example1 and Example2: br=30, ordmax=30, calc_unc=True, mpe(sel_freq=[...], order_in='find_min'), else an order"
)
PRESETS = ("Kvaale", "Reynders", "Neu", "Dederichs", "Magalhaes", "hdbscan")
VARIANTS = {f"pyOMA2 {name}": f"automatic preset {name}" for name in PRESETS}
VARIANTS["pyOMA2 by hand"] = "poles nearest to given frequencies, with deviations"


def run(test, variant):
    """Run SSI-cov, and cluster or pick."""
    from pyoma2.algorithms import SSI
    from pyoma2.algorithms.data.run_params import Clustering
    from pyoma2.setup.single import SingleSetup

    logging.disable()
    setup = SingleSetup(test.outputs, test.sampling_rate)
    if (q := test.human("decimation")) > 1:
        setup.decimate_data(q=q)
    preset = variant.removeprefix("pyOMA2 ")
    orders = {"ordmax": 30, "calc_unc": True} if preset == "by hand" else {"ordmax": 100, "step": 2}
    algorithm = SSI(name="ssi", method="cov", br=30, **orders)
    setup.add_algorithms(algorithm)
    setup.run_all()
    if preset == "by hand":
        return picked(test, setup, algorithm)
    algorithm.add_clustering(Clustering(name="automatic", quick=preset))
    algorithm.run_all_clustering()
    found = algorithm.result.clustering_results["automatic"]
    return {"frequencies": np.ravel(found.Fn), "damping_ratios": np.ravel(found.Xi), "shapes": found.Phi}


def picked(test, setup, algorithm):
    """Return the poles that a person picks, with their deviations."""
    frequencies = sorted(set(test.human("frequencies")))
    setup.mpe("ssi", sel_freq=frequencies, order_in="find_min")
    if not np.size(
        algorithm.result.Fn
    ):  # at no order it sees exactly these: a person names the order, here the largest
        test.told += 1
        setup.mpe("ssi", sel_freq=frequencies, order_in=30)
    found = algorithm.result
    told = {"frequencies": np.ravel(found.Fn), "damping_ratios": np.ravel(found.Xi), "shapes": found.Phi}
    for name, value, std in (("frequency", found.Fn, found.Fn_std), ("damping", found.Xi, found.Xi_std)):
        told[f"{name}_interval"] = np.ravel(value)[:, None] + 1.96 * np.outer(np.ravel(std), (-1, 1))
    return told
