"""
II-5, Eqs. 55-64: the shift of one factor
=========================================

.. math:: A = D^{-1/2}\\,[E P_n]^{\\#}\\,[\\sigma E P_n]\\,D^{1/2}

E drops the **last** block row, :math:`\\sigma E` the **first**: the text of the report has them the other way round, and every damping ratio would
change its sign. On correlations of ambient records this row is known as SSI-cov.
"""

import numpy as np

import modalscope as ms

response = ms.systems.chain5().impulse_response(80, noise=0.1, seed=0)
Y, r, c, n = response.values, 12, 30, 10
l = Y.shape[1]
H = np.block([[Y[i + j] for j in range(c)] for i in range(r + 1)])
Pn = np.linalg.svd(H)[0][:, :n]
A = np.linalg.pinv(Pn[:-l]) @ Pn[l:]


def apart(one, other):
    """How far sets of eigenvalues are apart."""
    return abs(np.linalg.eigvals(one)[:, None] - np.linalg.eigvals(other)).min(axis=1).max()


found = ms.identify(response, method="alternate", order=n, block_rows=r, block_columns=c)
print(f"Eq. 57 = the row alternate: {apart(A, found.state_space.A):.1e} (at most 1e-12)")
print(
    f"with first and last exchanged, as printed, A^-1 to {apart(np.linalg.inv(A), np.linalg.pinv(Pn[l:]) @ Pn[:-l]):.1e}"
)

# %%
# Eq. 56: it is the companion form of the null space, projected on the states.
last = Pn[r * l :] @ np.linalg.pinv(Pn[: r * l])
companion = np.vstack([np.hstack([np.zeros(((r - 1) * l, l)), np.eye((r - 1) * l)]), last])
print(f"Eq. 56 = Eq. 57: {abs(np.linalg.pinv(Pn[:-l]) @ companion @ Pn[:-l] - A).max():.1e} (at most 1e-12)")

# %%
# The inversion lemma behind the normal equations of Eq. 57, p the last l rows of P_n:
p = Pn[-l:].T
lemma = (np.eye(n) + p @ np.linalg.inv(np.eye(l) - p.T @ p) @ p.T) @ Pn[:-l].T
print(f"lemma: {abs(lemma - np.linalg.pinv(Pn[:-l])).max():.1e} (at most 1e-12)")

# %%
# And it is ERA on a Hankel matrix that was truncated to rank n before:
U, d, Vt = np.linalg.svd(H)
Hn = U[:, :n] * d[:n] @ Vt[:n]
P, e, Qt = np.linalg.svd(Hn[:-l])
era = P[:, :n].T @ Hn[l:] @ Qt[:n].T / np.sqrt(np.outer(e[:n], e[:n]))
print(f"ERA on the truncated matrix: {apart(era, A):.1e} (at most 1e-12)")
ms.plot.response(response, found)
