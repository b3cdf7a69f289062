"""pyOMA2, automatic: `python pyoma_2_automatic.py RECORD.npz [deviations]` prints the modes of a record as JSON."""

import contextlib
import io
import json
import logging
import sys
import time

import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.algorithms.data.run_params import Clustering
from pyoma2.setup.single import SingleSetup

logging.disable()


def modes(outputs, rate, deviations):
    """Return frequencies, damping ratios and half widths of 95 % intervals by SSI-cov and its clustering."""
    algorithm = SSI(name="ssi", method="cov", br=20, ordmax=40, calc_unc=deviations)
    setup = SingleSetup(outputs, rate)
    setup.add_algorithms(algorithm)
    setup.run_all()
    algorithm.add_clustering(Clustering(name="automatic", quick="Kvaale"))
    algorithm.run_all_clustering()
    found = algorithm.result.clustering_results["automatic"]
    unknown = np.full(np.shape(found.Fn), np.nan)
    stds = (found.Fn_std, found.Xi_std) if deviations else (unknown, unknown)
    columns = (found.Fn, found.Xi, *(1.96 * np.asarray(std) for std in stds))
    names = ("frequencies", "damping_ratios", "frequency_halves", "damping_halves")
    return {name: np.ravel(column).tolist() for name, column in zip(names, columns, strict=True)}


if __name__ == "__main__":
    with np.load(sys.argv[1]) as record, contextlib.redirect_stderr(io.StringIO()):
        start = time.process_time()
        found = modes(record["outputs"], float(record["sampling_rate"]), "deviations" in sys.argv)
        found["seconds"] = [time.process_time() - start]
    print(json.dumps(found))
