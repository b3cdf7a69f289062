"""
II-4, Eqs. 42-54: the null space and the companion form
=======================================================

What the truncation leaves out of :math:`H(0)` spans a null space, whose blocks are the coefficients of a matrix polynomial:

.. math:: \\sum_{i<r} \\tilde P_i\\, C A^i + C A^r = 0, \\qquad \\tilde A = \\begin{bmatrix} 0 & I & \\\\ & & \\ddots \\\\ -\\tilde P_0 & \\cdots & -\\tilde P_{r-1}
   \\end{bmatrix}

The report takes *the last l columns* of the null space; all of them, :math:`\\tilde P = -P_{nr}(E P_n)^{\\#}`, lose no digits and depend on no
choice of its basis. Printed signs are corrected.
"""

import numpy as np

import modalscope as ms

response = ms.systems.chain5().impulse_response(80, noise=0.1, seed=0)
Y, r, c, n = response.values, 8, 30, 10
l = Y.shape[1]
H = np.block([[Y[i + j] for j in range(c)] for i in range(r + 1)])
U = np.linalg.svd(H)[0]
Pn, Po = U[:, :n], U[:, n:]

# %%
# Eqs. 50-52: minimum norm by all columns of the null space, and by the kept ones.
by_null_space = np.linalg.pinv(Po[r * l :].T) @ Po[: r * l].T
by_kept = -Pn[r * l :] @ np.linalg.pinv(Pn[: r * l])
print(
    f"all columns of the null space = -P_nr (E P_n)#: {abs(by_null_space - by_kept).max() / abs(by_kept).max():.1e} (at most 1e-12)"
)

# %%
# Any other basis of the null space gives the same.
turned = Po @ np.linalg.qr(np.random.default_rng(0).standard_normal((Po.shape[1],) * 2))[0]
print(
    f"another basis: {abs(np.linalg.pinv(turned[r * l :].T) @ turned[: r * l].T - by_kept).max():.1e} (at most 1e-12)"
)

# %%
# Eqs. 53 and 54: the companion form, and its poles beside the library's row ``polyreference``.
companion = np.vstack([np.hstack([np.zeros(((r - 1) * l, l)), np.eye((r - 1) * l)]), -by_kept])
found = ms.identify(response, method="polyreference", form="observable", order=n, block_rows=r, block_columns=c)
own = np.linalg.eigvals(companion)
s = np.log(own.astype(complex)) * response.sampling_rate
print(
    "frequencies of all",
    own.size,
    "poles between",
    (abs(s) / 2 / np.pi).min().round(3),
    "and",
    (abs(s) / 2 / np.pi).max().round(3),
    "Hz",
)
errors = abs(found.modes.poles[:, None] - s).min(axis=1) / abs(found.modes.poles)
print(f"the modes of the row are among them: {errors.max():.1e} (at most 1e-11)")
print(f"the others are its {len(found.extraneous)} extraneous poles")
ms.plot.response(response, found)
