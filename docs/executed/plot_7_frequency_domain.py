"""
III, Eqs. 67-110: the same in the frequency domain
==================================================

On the lines of the discrete transform the matrix of shifted transfer functions is the Hankel matrix times a unitary one, :math:`H_g(k) = H(k)F`;
on continuous responses the differentiated ones are recurrences in :math:`j\\omega`, with the initial terms eliminated. The rows of the table are
the same, column by column: here each of them runs on the same continuous frequency responses.
"""

import numpy as np

import modalscope as ms

s = ms.systems.chain5()
exact = s.modes(quantity="acceleration")
f = np.linspace(0.3, 8, 200)
clean = s.frequency_response(f, quantity="acceleration")
for method in ("era", "polyreference", "alternate", "least_squares"):
    for domain in ("z", "s"):
        modes = ms.identify(clean, method=method, domain=domain, order=10, block_rows=6).modes
        error = abs(modes.poles[:, None] - exact.poles).min(axis=0) / abs(exact.poles)
        print(f"{method} in {domain}, largest error of a pole without noise: {error.max():.1e} (at most 1e-11)")

# %%
# Eqs. 81-82: a Hankel matrix of samples times a discrete transform.
Y = s.impulse_response(64).values
r, c = 4, 32
H = np.block([[Y[i + j] for j in range(c)] for i in range(r)])
m = Y.shape[2]
F = np.kron(np.exp(-2j * np.pi * np.outer(np.arange(c), np.arange(c)) / c) / np.sqrt(c), np.eye(m))
shifted = np.vstack([np.hstack(list(np.fft.fft(Y[i : i + c], axis=0) / np.sqrt(c))) for i in range(r)])
print(f"H_g(0) = H(0) F: {abs(shifted - H @ F).max() / abs(H).max():.1e} (at most 1e-12)")
print(
    f"F is unitary, so that singular values and poles are the same: {abs(F @ F.conj().T - np.eye(c * m)).max():.1e} (at most 1e-12)"
)

# %%
# Eqs. 102-109: with a sensor at each mass the last block row of the companion form is mass and stiffness.
three = ms.systems.three_masses()
data = three.frequency_response(np.linspace(0.1, 1.5, 300) * three.modes().frequencies.max())
model = ms.identify(data, method="polyreference", domain="s", order=6, block_rows=2).state_space
equations = ms.equations_of_motion(model)
exact_k = np.linalg.solve(three.mass, three.stiffness)
print(f"M^-1 K: {abs(equations.stiffness - exact_k).max() / abs(exact_k).max():.1e} (at most 1e-10)")
ms.plot.response(data, three.modes())
