"""pyOMA2: SSI-cov, its poles grouped by each automatic preset that is named after a paper or an algorithm, as its Example 5 does."""

import logging

import numpy as np

REQUIRES = ("pyoma_2==1.4.3",)
TAKES = ("ambient",)
SOURCE = "pyOMA2 1.4.3, Example5 - Clustering: decimation, SSI(br=30, ordmax=100, step=2, method='cov'), Clustering(quick=...)"
PRESETS = ("Kvaale", "Reynders", "Neu", "Dederichs", "Magalhaes", "hdbscan")
VARIANTS = {f"pyOMA2 {name}": f"automatic preset {name}" for name in PRESETS}


def run(test, variant):
    """Run SSI-cov, and cluster."""
    from pyoma2.algorithms import SSI
    from pyoma2.algorithms.data.run_params import Clustering
    from pyoma2.setup.single import SingleSetup

    logging.disable()
    setup = SingleSetup(test.outputs, test.sampling_rate)
    if (q := test.human("decimation")) > 1:
        setup.decimate_data(q=q)
    algorithm = SSI(name="ssi", method="cov", br=30, ordmax=100, step=2)
    setup.add_algorithms(algorithm)
    setup.run_all()
    algorithm.add_clustering(Clustering(name="automatic", quick=variant.removeprefix("pyOMA2 ")))
    algorithm.run_all_clustering()
    found = algorithm.result.clustering_results["automatic"]
    return {"frequencies": np.ravel(found.Fn), "damping_ratios": np.ravel(found.Xi), "shapes": found.Phi}
