"""scipy alone: the Hankel matrices built, the first decomposed (thin)."""

import numpy as np
import scipy.linalg as sla


def era(data):
    """A of one order by ERA."""
    Y, r, s, n = data["values"], int(data["rows"]), int(data["columns"]), int(data["order"])
    H = [np.vstack([np.hstack(list(Y[i + k : i + k + s])) for i in range(r)]) for k in (0, 1)]
    P, d, Qt = sla.svd(H[0], full_matrices=False)
    root = np.sqrt(d[:n])
    return P[:, :n].T @ H[1] @ Qt[:n].T / np.outer(root, root)
