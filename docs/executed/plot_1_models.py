"""
II-1, Eqs. 1-8: from masses and springs to a sampled model
==========================================================

.. math:: M\\ddot q + D\\dot q + Kq = B_f u, \\qquad \\bar A = \\begin{bmatrix} 0 & I \\\\ -M^{-1}K & -M^{-1}D \\end{bmatrix}, \\quad
   \\bar B = \\begin{bmatrix} 0 \\\\ M^{-1}B_f \\end{bmatrix}

Acceleration sensors need a direct term, which the report has not: :math:`y = C_a[-M^{-1}K, -M^{-1}D]\\,x + C_a M^{-1}B_f\\,u`.
"""

import numpy as np
import scipy.linalg

import modalscope as ms

s = ms.systems.chain5()
M, D, K, n = s.mass, s.damping, s.stiffness, s.degrees
A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
B = np.vstack([np.zeros((n, n)), np.linalg.inv(M)])
model = s.state_space(outputs=s.dofs, inputs=s.dofs)
print(f"Eqs. 2-4, A: {abs(model.A - A).max():.1e} (at most 1e-12)")
print(f"Eqs. 2-4, B: {abs(model.B - B).max():.1e} (at most 1e-12)")

# %%
# Eqs. 7 and 8: a force that is held from sample to sample gives :math:`A = e^{\bar A \Delta t}`,
# :math:`B = \int_0^{\Delta t} e^{\bar A t}\,dt\,\bar B`.
dt = s.dt
both = scipy.linalg.expm(dt * np.block([[A, B], [np.zeros((n, 3 * n))]]))
held = s.state_space(outputs=s.dofs, inputs=s.dofs, dt=dt)
print(f"Eq. 8, A: {abs(held.A - both[: 2 * n, : 2 * n]).max():.1e} (at most 1e-12)")
print(f"Eq. 8, B: {abs(held.B - both[: 2 * n, 2 * n :]).max():.1e} (at most 1e-12)")

# %%
# Poles of the sampled model are exponentials of those of the structure.
left = np.sort_complex(np.exp(np.linalg.eigvals(A) * dt))
print(f"poles: {abs(np.sort_complex(np.linalg.eigvals(held.A)) - left).max():.1e} (at most 1e-12)")

# %%
# And the frequency response is :math:`(j\omega)^2 (K - \omega^2 M + j\omega D)^{-1}` for accelerations:
f = np.linspace(0.2, 8, 500)
w = 2 * np.pi * f
direct = np.array([-(v**2) * np.linalg.inv(K - v**2 * M + 1j * v * D) for v in w])
frf = s.frequency_response(f, outputs=s.dofs, inputs=s.dofs, quantity="acceleration")
print(f"frequency response: {abs(frf.values - direct).max() / abs(direct).max():.1e} (at most 1e-12)")
ms.plot.response(frf, s.modes(outputs=s.dofs, inputs=s.dofs, quantity="acceleration"), 0, 0)
