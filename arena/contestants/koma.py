"""KOMA: covariance-driven SSI, stable poles grouped by HDBSCAN, all settings those of its notebook "Automatic OMA - Shear frame"."""

import numpy as np

REQUIRES = ("koma-python==1.3.6",)
TAKES = ("ambient",)
SOURCE = (
    "KOMA, examples/Automatic OMA - Shear frame.ipynb: i = 50, orders 2 to 60, s = 3, cluster size 15, probability 1"
)
VARIANTS = {"KOMA": "covariance-driven SSI and HDBSCAN"}


def run(test, variant):
    """Run Cov-SSI and cluster."""
    import koma.clustering
    import koma.oma
    from scipy.signal import detrend

    y, rate = test.slower(detrend(test.outputs, axis=0, type="constant"))
    stability = {"freq": 0.05, "damping": 0.2, "mac": 0.2}
    poles = koma.oma.covssi(y, rate, 50, np.arange(2, 62, 2))
    poles, shapes, orders, _ = koma.oma.find_stable_poles(*poles, 3, stabcrit=stability, indicator="freq")
    options = {"min_cluster_size": 15, "min_samples": 15, "scaling": {"mac": 0.4, "omega_n": 0.8}}
    options |= {"normalize_distances": False, "boolean_stops": "avoid_same_order"}
    groups = koma.clustering.PoleClusterer(poles, shapes, orders, **options)
    groups.cluster()
    outputs = groups.postprocess(prob_threshold=1.0, normalize_and_maxreal=True)
    xi, omega, phi, *_ = koma.clustering.group_clusters(*outputs)
    return {
        "frequencies": [np.mean(x) / 2 / np.pi for x in omega],
        "damping_ratios": [np.mean(x) for x in xi],
        "shapes": np.array([np.mean(x, axis=1) for x in phi]).T,
    }
