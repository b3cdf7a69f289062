"""
III, Eqs. 67-110: the same in the frequency domain
==================================================

On the lines of the discrete transform the matrix of shifted transfer functions is the Hankel matrix times a unitary one, :math:`H_g(k) = H(k)F`;
on continuous responses the differentiated ones are recurrences in :math:`j\\omega`, with the initial terms eliminated. The rows of the table are
the same, column by column: here each of them runs on the same continuous frequency responses.
"""

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm

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
# Section III-1. Eq. 74, corrected: :math:`Y(t) = \frac{1}{2\pi}\int_{-\infty}^{\infty} Y(j\omega)\,e^{j\omega t}\,d\omega`, here for
# displacements; what is odd in :math:`\omega` cancels.
continuous = s.state_space()
Ab, Bb, Cb, n = continuous.A, continuous.B, continuous.C, 10


def stated(what, expected, computed, limit):
    difference = abs(computed - expected) / abs(expected)
    print(f"{what}: expected {expected:.10g}, computed {computed:.10g}, apart by {difference:.1e} (at most {limit})")


t = 0.5
transform = [
    quad(lambda w, p=p: getattr(continuous.transfer([1j * w])[0, 0, 0], p), 0, np.inf, weight=weight, wvar=t)[0]
    for p, weight in (("real", "cos"), ("imag", "sin"))
]
stated("Eq. 74, Y(t) at 0.5 s", (Cb @ expm(Ab * t) @ Bb)[0, 0], (transform[0] - transform[1]) / np.pi, 1e-7)

# %%
# Eq. 76: a sum over samples is :math:`CG(j\omega)B` with :math:`G = \Delta t\,(I - Az^{-1})^{-1}`, which falls short of the integral by
# :math:`\frac{\Delta t}{2}\,Y(0)` and by :math:`O(\Delta t^2)`: a quarter of it at half the step. Velocities begin at a value of their own.
velocity, w = s.state_space(quantity="velocity"), 2 * np.pi * 1.3
integral = velocity.transfer([1j * w])[0]
left = []
for dt in (0.002, 0.001):
    A = expm(Ab * dt)
    total = dt * velocity.C @ np.linalg.solve(np.eye(n) - A * np.exp(-1j * w * dt), Bb)
    left.append(abs(total - dt / 2 * velocity.C @ Bb - integral).max())
stated("Eq. 76, error at a step over that at half of it", 4.0, left[0] / left[1], 1e-3)

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
# Eqs. 104-107: with a displacement sensor at each mass two block rows are a realization, its last row is stiffness and damping over mass,
# and it needs no more than the responses and what they begin with.
three = ms.systems.three_masses()
model = three.state_space(outputs=three.dofs)
lines = 2j * np.pi * np.linspace(0.1, 1.5, 300) * three.modes().frequencies.max()
Y0 = model.transfer(lines)
Y1 = lines[:, None, None] * Y0 - model.C @ model.B
Y2 = lines[:, None, None] * Y1 - model.C @ model.A @ model.B


def last_row(below, row):
    """P of row + P below = 0 on all lines and inputs; real and imaginary parts stand side by side."""
    known, target = (np.hstack([np.hstack([v.real, v.imag]) for v in part]) for part in (below, row))
    return -np.linalg.lstsq(known.T, target.T, rcond=None)[0].T


P = last_row(np.concatenate([Y0, Y1], axis=1), Y2)
companion = np.block([[np.zeros((3, 3)), np.eye(3)], [-P]])
B = np.array([(x * np.eye(6) - companion) @ np.vstack(pair) for x, *pair in zip(lines, Y0, Y1, strict=True)])
print(f"Eq. 106, B is the same from every line: {abs(B - B.mean(axis=0)).max() / abs(B).max():.1e} (at most 1e-10)")
again = [np.linalg.solve(x * np.eye(6) - companion, B.mean(axis=0))[:3] for x in lines]
print(f"Eq. 106, responses of the realization: {abs(again - Y0).max() / abs(Y0).max():.1e} (at most 1e-10)")
K, D = (np.linalg.solve(three.mass, each) for each in (three.stiffness, three.damping))
stated("Eq. 107, first element of M^-1 K", K[0, 0], P[0, 0], 1e-10)
stated("Eq. 107, first element of M^-1 D", D[0, 0], P[0, 3], 1e-10)
data = three.frequency_response(lines.imag / 2 / np.pi)
identified = ms.identify(data, method="polyreference", domain="s", order=6, block_rows=2).state_space
equations = ms.equations_of_motion(identified)
print(f"Eq. 107, M^-1 K: {abs(equations.stiffness - K).max() / abs(K).max():.1e} (at most 1e-10)")
print(f"Eq. 107, M^-1 D: {abs(equations.damping - D).max() / abs(D).max():.1e} (at most 1e-10)")

# %%
# Eqs. 108 and 109: with displacements and velocities at each mass one block row is enough, :math:`C\bar A + \tilde P_{o0}^TC = 0`.
full = np.vstack([model.C, model.C @ model.A])
Z0 = np.concatenate([Y0, Y1], axis=1)
Z1 = lines[:, None, None] * Z0 - full @ model.B
P = last_row(Z0, Z1)
print(f"Eq. 108: {abs(full @ model.A + P @ full).max() / abs(P @ full).max():.1e} (at most 1e-10)")
B = np.array([(x * np.eye(6) + P) @ v for x, v in zip(lines, Z0, strict=True)])
print(
    f"Eq. 109, B = C B at every line: {abs(B - full @ model.B).max() / abs(full @ model.B).max():.1e} (at most 1e-10)"
)

# %%
# Eq. 110: the shift of one factor on shifted transfer functions; C is the first block row of :math:`P_nD_n^{1/2}`.
z = np.exp(1j * 2 * np.pi * f * s.dt)
sampled = s.state_space(dt=s.dt)
power = [np.linalg.matrix_power(sampled.A, k) for k in range(7)]
G = np.array([np.linalg.inv(v * np.eye(n) - sampled.A) for v in z])
H = np.hstack([np.vstack([sampled.C @ Ak @ g @ sampled.B for Ak in power]) for g in G])
U, d, Q = np.linalg.svd(H, full_matrices=False)
U, root, Q, l = U[:, :n], np.sqrt(d[:n]), Q[:n], sampled.C.shape[0]
A = np.linalg.pinv(U[:-l]) @ U[l:] * root / root[:, None]
B = (z[0] * np.eye(n) - A) @ (root[:, None] * Q[:, :m])
got, exact_poles = np.linalg.eigvals(A), np.linalg.eigvals(sampled.A)
print(f"Eq. 110, poles: {abs(got[:, None] - exact_poles).min(axis=1).max():.1e} (at most 1e-10)")
model_110 = [(U * root)[:l] @ np.linalg.solve(v * np.eye(n) - A, B) for v in z]
true = [sampled.C @ g @ sampled.B for g in G]
print(
    f"Eq. 110, C G B on all lines: {abs(np.subtract(model_110, true)).max() / abs(np.array(true)).max():.1e} (at most 1e-10)"
)
ms.plot.response(data, three.modes())
