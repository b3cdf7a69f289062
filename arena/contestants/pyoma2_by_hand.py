"""pyOMA2: SSI-cov, poles picked by a person as in its Example 1, with the deviations that it computes where it is asked to."""

import logging

import numpy as np

REQUIRES = ("pyoma_2==1.4.3",)
TAKES = ("ambient",)
SOURCE = "pyOMA2 1.4.3, Example1 and Example2: br=30, ordmax=30, calc_unc=True, mpe(sel_freq=[...], order_in='find_min'), else an order"
VARIANTS = {"pyOMA2 by hand": "poles nearest to given frequencies, with deviations"}


def run(test, variant):
    """Run SSI-cov, and pick."""
    from pyoma2.algorithms import SSI
    from pyoma2.setup.single import SingleSetup

    logging.disable()
    setup = SingleSetup(test.outputs, test.sampling_rate)
    if (q := test.human("decimation")) > 1:
        setup.decimate_data(q=q)
    algorithm = SSI(name="ssi", method="cov", br=30, ordmax=30, calc_unc=True)
    setup.add_algorithms(algorithm)
    setup.run_all()
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
