"""
II-2, Eqs. 9-23: Markov parameters and the Hankel matrix
========================================================

.. math:: Y(k) = CA^kB, \\qquad H(k) = \\begin{bmatrix} Y(k) & Y(k+1) & \\cdots \\\\ Y(k+1) & Y(k+2) & \\\\ \\vdots & & \\ddots \\end{bmatrix} = V A^k W

``values[k]`` is :math:`CA^kB`: the sample of a pulse response at k + 1 (the report's Eqs. 9 to 11 shift the sequence by one).
"""

import numpy as np

import modalscope as ms

s = ms.systems.chain5()
model = s.state_space(dt=s.dt)
response = s.impulse_response(80)
Y = response.values
by_power = np.array([model.C @ np.linalg.matrix_power(model.A, k) @ model.B for k in range(80)])
print(f"Y(k) = C A^k B: {abs(Y - by_power).max() / abs(Y).max():.1e} (at most 1e-12)")


def hankel(k, rows, columns):
    return np.block([[Y[i + j + k] for j in range(columns)] for i in range(rows)])


# %%
# Eq. 17 asks for as many block rows as there are states; as many as the observability index are enough. Here three carry all ten states:
ranks = {rows: int(np.linalg.matrix_rank(hankel(0, rows, 20), tol=1e-10)) for rows in (1, 2, 3, 10)}
print("block rows and rank", ranks)
print(f"states that three block rows lack: {10 - ranks[3]} (at most 0)")

# %%
# Eq. 22: :math:`W\,H(0)^{\#}\,V = I`, whatever the coordinates of the states.
V = np.vstack([model.C @ np.linalg.matrix_power(model.A, k) for k in range(10)])
W = np.hstack([np.linalg.matrix_power(model.A, k) @ model.B for k in range(30)])
H0, H1 = hankel(0, 10, 30), hankel(1, 10, 30)
print(f"H(1) = V A W: {abs(H1 - V @ model.A @ W).max() / abs(H1).max():.1e} (at most 1e-12)")
print(f"W H# V = I:   {abs(W @ np.linalg.pinv(H0, rcond=1e-12) @ V - np.eye(10)).max():.1e} (at most 1e-10)")

# %%
# The singular values of H(0): ten, and rounding.
ms.plot.singular_values(np.linalg.svd(H0, compute_uv=False)[:30], order=10)
