"""pyoma-toolbox (pyOMA): covariance-driven SSI and its three automatic stages, as its page on continuous monitoring does."""

import logging

import numpy as np

REQUIRES = ("pyoma-toolbox==1.1.0",)
TAKES = ("ambient",)
SOURCE = (
    "pyoma-toolbox 1.1.0, scripts/single_setup_analysis.py with its ssi_config.txt (200 lags, 45 block columns, order 40); "
    "doc/continuous_monitoring.rst (clearing, classification, selection)"
)
VARIANTS = {"pyoma-toolbox": "covariance-driven SSI and clustering"}


def run(test, variant):
    """Identify and cluster."""
    logging.disable()
    from pyOMA.core import BRSSICovRef, PreProcessSignals, StabilCluster

    prepared = PreProcessSignals(np.array(test.outputs), test.sampling_rate)
    if (q := test.human("decimation")) > 1:
        prepared.decimate_signals(q)
    prepared.correlation(m_lags=200)
    model = BRSSICovRef(prepared)
    model.build_toeplitz_cov(num_block_columns=45)
    model.compute_modal_params(max_model_order=40)
    chosen = StabilCluster(model)
    chosen.calculate_stabilization_masks(d_range=(0, 0.10), df_max=0.01, dd_max=0.05, dmac_max=0.05)
    chosen.automatic_clearing()
    chosen.automatic_classification()
    chosen.automatic_selection()
    f, zeta, shapes, *_ = chosen.get_selected_modal_values()
    return {"frequencies": f, "damping_ratios": np.array(zeta, float) / 100, "shapes": np.asarray(shapes)}
