"""pyOMA2: setups with common sensors, scaled before they are identified together (PreGER), picked by a person as in its Example 4."""

import logging

import numpy as np

REQUIRES = ("pyoma_2==1.4.3",)
TAKES = ("setups",)
SOURCE = "pyOMA2 1.4.3, Example4 (PreGER): decimation, SSI_MS(method='cov', br=80, ordmax=100, step=2), mpe(sel_freq=[...], order_in=80)"
VARIANTS = {"pyOMA2 setups by hand": "covariance-driven SSI of all setups, poles nearest to given frequencies"}


def run(test, variant):
    """Identify all setups together and pick."""
    from pyoma2.algorithms import SSI_MS
    from pyoma2.setup import MultiSetup_PreGER

    logging.disable()
    common = [name for name in test.labels[0] if all(name in own for own in test.labels)]
    references = [[own.index(name) for name in common] for own in test.labels]
    setup = MultiSetup_PreGER(fs=test.sampling_rate, ref_ind=references, datasets=test.setups)
    if (q := test.human("decimation")) > 1:
        setup.decimate_data(q=q)
    algorithm = SSI_MS(name="ssi", method="cov", br=80, ordmax=100, step=2)
    setup.add_algorithms(algorithm)
    setup.run_all()
    setup.mpe("ssi", sel_freq=test.human("frequencies"), order_in=80)
    found = algorithm.result
    order = common + [name for own in test.labels for name in own if name not in common]
    f, zeta = np.ravel(found.Fn), np.ravel(found.Xi)
    return {"frequencies": f, "damping_ratios": zeta, "shapes": found.Phi, "labels": order}
