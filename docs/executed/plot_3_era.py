"""
II-3, Eqs. 24-41: the eigensystem realization algorithm
=======================================================

.. math:: H(0) = P D Q^T, \\qquad A = D^{-1/2} P^T H(1)\\, Q\\, D^{-1/2}, \\quad B = D^{1/2} Q^T E_m, \\quad C = E_l^T P D^{1/2}
"""

import numpy as np

import modalscope as ms

response = ms.systems.chain5().impulse_response(80, noise=0.1, seed=0)  # 20 dB: identities hold with noise
Y, r, c, n = response.values, 12, 30, 10
l, m = Y.shape[1:]
H0, H1 = (np.block([[Y[i + j + k] for j in range(c)] for i in range(r)]) for k in (0, 1))
P, d, Qt = np.linalg.svd(H0)
P, d, Q = P[:, :n], d[:n], Qt[:n].T
A = P.T @ H1 @ Q / np.sqrt(np.outer(d, d))
B, C = np.sqrt(d)[:, None] * Q.T[:, :m], P[:l] * np.sqrt(d)


def apart(one, other):
    """How far sets of eigenvalues are apart."""
    return abs(np.linalg.eigvals(one)[:, None] - np.linalg.eigvals(other)).min(axis=1).max()


found = ms.identify(response, method="era", order=n, block_rows=r, block_columns=c)
model = found.state_space
print(f"Eq. 28, poles: {apart(A, model.A):.1e} (at most 1e-12)")
ours = np.array([model.C @ np.linalg.matrix_power(model.A, k) @ model.B for k in range(20)])
here = np.array([C @ np.linalg.matrix_power(A, k) @ B for k in range(20)])
print(f"C A^k B:       {abs(ours - here).max() / abs(here).max():.1e} (at most 1e-11)")

# %%
# Eq. 30, corrected: :math:`V^TV = D = WW^T`, the model is balanced over the samples that were read.
V, W = P * np.sqrt(d), np.sqrt(d)[:, None] * Q.T
print(f"V'V = D: {abs(V.T @ V - np.diag(d)).max() / d[0]:.1e} (at most 1e-12)")
print(f"W W' = D: {abs(W @ W.T - np.diag(d)).max() / d[0]:.1e} (at most 1e-12)")

# %%
# Eqs. 31-41: rows compressed by the leading directions T = P' lose nothing.
T = np.linalg.svd(H0)[0][:, : 2 * n].T
small = ms.identify(response, method="era", order=n, block_rows=r, block_columns=c, row_compression=T)
print(f"alternate ERA with T = P': {apart(small.state_space.A, A):.1e} (at most 1e-12)")

# %%
# Eq. 10 of the identities: the first Markov parameter of the model is that of the truncated matrix.
print(f"C B = first block of P D Q': {abs(C @ B - (P * d @ Q.T)[:l, :m]).max():.1e} (at most 1e-12)")
ms.plot.response(response, found)
