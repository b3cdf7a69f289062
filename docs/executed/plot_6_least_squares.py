"""
II-6, Eqs. 65-66: regression, Ibrahim's method, the complex exponential
=======================================================================

.. math:: \\tilde A = H(1)\\,H(0)^{\\#}

*Subject to uncertain results*, says the report: true without truncation. With the pseudo-inverse of rank n its nonzero poles are those of ERA.
"""

import numpy as np

import modalscope as ms

response = ms.systems.chain5().impulse_response(80, noise=0.1, seed=0)
Y, r, c, n = response.values, 10, 30, 10
H0, H1 = (np.block([[Y[i + j + k] for j in range(c)] for i in range(r)]) for k in (0, 1))
P, d, Qt = np.linalg.svd(H0, full_matrices=False)
inverse = Qt[:n].T / d[:n] @ P[:, :n].T
poles = np.linalg.eigvals(H1 @ inverse)
poles = poles[np.argsort(-abs(poles))]
era = np.linalg.eigvals(P[:, :n].T @ H1 @ Qt[:n].T / d[:n])
print(f"truncated regression = ERA: {abs(poles[:n][:, None] - era).min(axis=1).max():.1e} (at most 1e-12)")
print(f"its other poles: {abs(poles[n:]).max():.1e} (at most 1e-12)")

# %%
# The library's row, by either of two of its names:
one = ms.identify(response, method="least_squares", order=n, block_rows=r, block_columns=c)
other = ms.identify(response, method="itd", order=n, block_rows=r, block_columns=c)
print(f"least_squares = itd: {abs(one.modes.poles - other.modes.poles).max():.1e} (at most 1e-12)")
print(f"and Eq. 65: {abs(np.linalg.eigvals(one.state_space.A)[:, None] - era).min(axis=1).max():.1e} (at most 1e-12)")

# %%
# Without truncation: the last block column of the controllable companion form is the complex exponential's own least squares.
p, rows = 6, 40
known = np.block([[Y[i + j] for j in range(p)] for i in range(rows)])
target = np.vstack([Y[i + p] for i in range(rows)])
a = np.linalg.lstsq(known, target, rcond=None)[0]
m = Y.shape[2]
companion = np.zeros((p * m, p * m))
companion[m:, :-m] = np.eye((p - 1) * m)
companion[:, -m:] = a
prce = ms.identify(response, method="prce", order=p * m, block_rows=rows, block_columns=p)
apart = abs(np.linalg.eigvals(prce.state_space.A)[:, None] - np.linalg.eigvals(companion)).min(axis=1).max()
print(f"polyreference complex exponential: {apart:.1e} (at most 1e-11)")
ms.plot.response(response, one)
