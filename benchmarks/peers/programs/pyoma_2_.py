"""pyOMA2: its functions, without the classes that draw."""

import logging

import numpy as np
from pyoma2.functions.ssi import SSI_fast, SSI_poles, build_hank

logging.disable()


def ssi_cov(data):
    """All orders by covariances."""
    return _all_orders(data, "cov")


def ssi_cov_r(data):
    """All orders by covariances that are estimated once a lag."""
    return _all_orders(data, "cov_R")


def ssi_data(data):
    """All orders by the projection of the record on its past."""
    return _all_orders(data, "dat")


def _all_orders(data, method):
    y, rows, largest = data["outputs"].T, int(data["rows"]), int(data["largest"])
    y = y - y.mean(axis=1, keepdims=True)
    H, _ = build_hank(y, y, rows, method)
    O, A, C, _ = SSI_fast(H, rows, largest)
    SSI_poles(O, A, C, largest, 1.0, HC=False)
    return np.linalg.eigvals(A[int(data["order"])])
