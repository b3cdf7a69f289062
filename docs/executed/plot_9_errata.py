"""
Errata: what is printed wrong, and what it gives
================================================

Every equation below stands in the report otherwise than it can be. Each is computed twice without noise: as printed, which leaves an error that
no rounding makes, and corrected. Pages are those that the report's contents give for the section. Slips that a reader corrects at once, such as a
letter or a wrong number of an equation, are left out. A machine-read copy of the report was at hand: a few may be slips of that copy.
"""

import numpy as np
from matplotlib import pyplot
from scipy.integrate import quad
from scipy.linalg import expm

import modalscope as ms

s = ms.systems.chain5()
model, continuous = s.state_space(dt=s.dt), s.state_space()
A, B, C = model.A, model.B, model.C
n, m, l = 10, B.shape[1], C.shape[0]
power = [np.linalg.matrix_power(A, k) for k in range(80)]
Y = np.array([C @ Ak @ B for Ak in power])
V, W = np.vstack([C @ power[k] for k in range(9)]), np.hstack([power[k] @ B for k in range(31)])
H0, H1 = V @ W, V @ A @ W


def off(got, true):
    """How far arrays are apart; without bound where their sizes differ."""
    same = np.shape(got) == np.shape(true)
    return float(np.linalg.norm(np.subtract(got, true)) / np.linalg.norm(true)) if same else np.inf


def erratum(place, printed, wrong, corrected, right):
    print(f"{place}, as printed, {printed}: {wrong:.1e} (at least 0.001)")
    print(f"{place}, corrected, {corrected}: {right:.1e} (at most 1e-10)")


# %%
# Section II-1. A held unit pulse reaches the sensors one sample later than the text says, and a Dirac impulse alone leaves B as it is.
pulse, x = [], np.zeros((n, m))
for k in range(40):
    pulse.append(C @ x)
    x = A @ x + (B if k == 0 else 0)
erratum("Eqs. 9-11, pages 3-5", "y(k) = C A^k B", off(pulse, Y[:40]), "y(k) = C A^(k-1) B", off(pulse[1:], Y[:39]))
samples = s.state_space(dt=s.dt, input="dirac").B
held = np.linalg.solve(continuous.A, A - np.eye(n)) @ continuous.B
erratum(
    "Eq. 8, pages 3-5",
    "B of a pulse is that of an impulse",
    off(B, samples),
    "B of a pulse is the integral",
    off(B, held),
)

# %%
# Section II-3. Shifts of rows count by rows, those of columns by columns.
shifts, times = (0, 2, 5), (0, 1, 4)
asked = np.block([[Y[a + 1 + b] for b in times] for a in shifts])
printed = np.block([[Y[shifts[i] + 1 + times[j]] for i in range(3)] for j in range(3)])
Vs, Ws = np.vstack([C @ power[k] for k in shifts]), np.hstack([power[k] @ B for k in times])
erratum(
    "Eq. 20, pages 7-12", "Y(s_i + k + t_j)", off(printed, Vs @ A @ Ws), "Y(s_j + k + t_i)", off(asked, Vs @ A @ Ws)
)

# %%
# Factors that are not orthonormal: their pseudo-inverses stand in A alone.
P, d, Qt = np.linalg.svd(H0)
P, d, Q = P[:, :n], d[:n], Qt[:n].T
root = np.sqrt(d)
mix = np.eye(n) + np.triu(np.full((n, n), 0.1), 1)
F, G = P @ mix, Q * d @ np.linalg.inv(mix).T  # H(0) = F G'
mixed = np.linalg.pinv(F) @ H1 @ np.linalg.pinv(G.T)


def markov(a, b, c, count=20):
    return np.array([c @ np.linalg.matrix_power(a, k) @ b for k in range(count)])


erratum(
    "Eq. 28, remark, pages 7-12",
    "Q^T becomes a pseudo-inverse in B, too",
    off(markov(mixed, np.linalg.pinv(G)[:, :m], F[:l]), Y[:20]),
    "B keeps Q^T",
    off(markov(mixed, G.T[:, :m], F[:l]), Y[:20]),
)
Vb, Wb = P * root, root[:, None] * Q.T
erratum("Eq. 30, pages 7-12", "V V^T = D", off(Vb @ Vb.T, np.diag(d)), "V^T V = D", off(Vb.T @ Vb, np.diag(d)))

# %%
# Rows that are combined by T (Eqs. 31-41): three exponents have the wrong sign, and one is missing.
T = np.random.default_rng(0).standard_normal((14, H0.shape[0]))
Pt, dt_, Qt = np.linalg.svd(T @ H0, full_matrices=False)
Pt, r, Qt = Pt[:, :n], np.sqrt(dt_[:n]), Qt[:n].T
At = Pt.T @ (T @ H1) @ Qt / np.outer(r, r)
true = T @ V @ power[3] @ W
erratum(
    "Eq. 35, pages 7-12",
    "the bracket without its exponent k",
    off(Pt * r @ At @ (r[:, None] * Qt.T), true),
    "the bracket to the power k",
    off(Pt * r @ np.linalg.matrix_power(At, 3) @ (r[:, None] * Qt.T), true),
)
erratum(
    "Eq. 36, pages 7-12",
    "V = P D^-1/2, W = D^-1/2 Q^T",
    off(Pt / r @ (Qt / r).T, T @ H0),
    "V = P D^1/2, W = D^1/2 Q^T",
    off(Pt * r @ (Qt * r).T, T @ H0),
)
Ct = (H0 @ Qt / r)[:l]
erratum(
    "Eqs. 37 and 41, pages 7-12",
    "B = D^-1/2 Q^T E_m",
    off(markov(At, (Qt / r).T[:, :m], Ct), Y[:20]),
    "B = D^1/2 Q^T E_m",
    off(markov(At, (Qt * r).T[:, :m], Ct), Y[:20]),
)
Vt = H0 @ Qt / r
erratum(
    "Eq. 38, pages 7-12",
    "H(0) = V D^-1/2 Q^T",
    off(Vt @ (Qt / r).T, H0),
    "H(0) = V D^1/2 Q^T",
    off(Vt @ (Qt * r).T, H0),
)

# %%
# All measurements added to one row: a sum of sensors does not see the modes in which they cancel.
fixed = ms.systems.Structure(
    mass=np.eye(5), stiffness=100 * (2 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1)), damping=0.01 * np.eye(5)
).state_space(dt=0.05)
one, all_rows = fixed.C.sum(axis=0, keepdims=True), fixed.C


def missing(c, a):
    seen = np.vstack([c @ np.linalg.matrix_power(a, k) for k in range(10)])
    return a.shape[0] - np.linalg.matrix_rank(seen, tol=1e-8 * np.linalg.norm(seen, 2))


erratum(
    "Eq. 41, remark, pages 7-12",
    "all measurements may be added: states that are lost",
    missing(one, fixed.A),
    "rows as they are: states that are lost",
    missing(all_rows, fixed.A),
)

# %%
# Section II-4. The polynomial has a minus sign, in both forms, and its coefficients want all columns of the null space.
R = 8
Hr = np.block([[Y[i + j] for j in range(30)] for i in range(R + 1)])
Po = np.linalg.svd(Hr)[0][:, n:]
coefficients = np.linalg.pinv(Po[R * l :].T) @ Po[: R * l].T
below = np.vstack([C @ power[k] for k in range(R)])
erratum(
    "Eqs. 52a and 99, pages 12-16 and 26-29",
    "C A^r = + sum P_i C A^i",
    off(coefficients @ below, C @ power[R]),
    "C A^r = - sum P_i C A^i",
    off(-coefficients @ below, C @ power[R]),
)
Qo = np.linalg.svd(np.block([[Y[i + j] for j in range(R + 1)] for i in range(30)]))[2][n:].T
ahead = Qo[: R * m] @ np.linalg.pinv(Qo[R * m :])
beside = np.hstack([power[k] @ B for k in range(R)])
erratum(
    "Eqs. 52b, 53b and 54b, pages 12-16",
    "A^s B = + sum A^i B Q_i",
    off(beside @ ahead, power[R] @ B),
    "A^s B = - sum A^i B Q_i",
    off(-beside @ ahead, power[R] @ B),
)
last = np.linalg.solve(Po[R * l :, -l:].T, Po[: R * l, -l:].T)
turned = Po @ np.linalg.qr(np.random.default_rng(1).standard_normal((Po.shape[1],) * 2))[0]
again = np.linalg.pinv(turned[R * l :].T) @ turned[: R * l].T
other = np.linalg.solve(turned[R * l :, -l:].T, turned[: R * l, -l:].T)
erratum(
    "Eqs. 50-52, pages 12-16",
    "the last l columns, by two bases of the null space",
    off(last, other),
    "all columns, by two bases",
    off(coefficients, again),
)

# %%
# Section II-5. E drops the last block row, and the shift of a factor takes its pseudo-inverse.
Pn, dn, Qn = np.linalg.svd(Hr, full_matrices=False)
Pn, Qn = Pn[:, :n], Qn[:n].T
poles = np.linalg.eigvals(A)


def apart(matrix):
    return float(abs(np.linalg.eigvals(matrix)[:, None] - poles).min(axis=1).max())


erratum(
    "Eqs. 57 and 110, text, pages 16-18 and 29-31",
    "E P without its first rows",
    apart(np.linalg.pinv(Pn[l:]) @ Pn[:-l]),
    "E P without its last rows",
    apart(np.linalg.pinv(Pn[:-l]) @ Pn[l:]),
)
before, after = Qn[:-m], Qn[m:]
erratum(
    "Eq. 58, pages 16-18",
    "[sE Q]^T [E Q]#: the product does not exist",
    0.0 if after.shape[0] == np.linalg.pinv(before).shape[0] else np.inf,
    "[sE Q]^T ([E Q]^T)#",
    apart(after.T @ np.linalg.pinv(before.T)),
)
erratum(
    "Eq. 64, pages 16-18",
    "[sE Q]^T [E Q]",
    apart(after.T @ before),
    "[sE Q]^T ([E Q]^T)#",
    apart(after.T @ np.linalg.pinv(before.T)),
)

# %%
# Section III-1. Derivatives multiply by the state matrix; initial values are taken away; a convolution begins one sample later.
Ab, Bb = continuous.A, continuous.B
w = 2 * np.pi * 1.3
G = np.linalg.inv(1j * w * np.eye(n) - Ab)
left = (1j * w) ** 2 * C @ G @ Bb - 1j * w * C @ Bb - C @ Ab @ Bb
one_line = continuous.transfer  # Y(jw)
parts = [
    quad(lambda v, p=p: getattr(one_line([1j * v])[0, 0, 0], p), 0, np.inf, weight=weight, wvar=0.5, epsabs=1e-13)[0]
    for p, weight in (("real", "cos"), ("imag", "sin"), ("real", "sin"), ("imag", "cos"))
]
half = parts[0] - parts[1] + 1j * (parts[2] + parts[3])  # of Y(jw) exp(jwt) from 0 on: at -w it is the conjugate
pulse_at = (C @ expm(0.5 * Ab) @ Bb)[0, 0]
erratum(
    "Eq. 74, pages 20-22",
    "Y(t) is the integral of Y(s) exp(st) from -inf to 0",
    off(1j * half.conjugate(), pulse_at),
    "from -j inf to j inf, over 2 pi j",
    off(half.real / np.pi, pulse_at),
)
Cv, step = s.state_space(quantity="velocity").C, 0.01
shift = expm(Ab * step) * np.exp(-1j * w * step)  # A/z
factor, total, doubled = shift, np.eye(n), 1
while doubled < 1e6:  # sums of twice as many terms each time
    total, factor, doubled = total + factor @ total, factor @ factor, 2 * doubled
erratum(
    "Eq. 76, pages 20-22",
    "sum of Y(k) z^-k dt is the integral C G B",
    off(step * Cv @ total @ Bb, Cv @ G @ Bb),
    "it is C dt (I - A/z)^-1 B",
    off(step * Cv @ total @ Bb, step * Cv @ np.linalg.inv(np.eye(n) - shift) @ Bb),
)
inverse = np.linalg.inv(Ab)
erratum(
    "Eqs. 75 and 77, pages 20-22",
    "C A^-i G B",
    off(C @ inverse @ inverse @ G @ Bb, left),
    "C A^i G B",
    off(C @ Ab @ Ab @ G @ Bb, left),
)
direct = s.frequency_response([1.3], quantity="acceleration").values[0]
erratum(
    "Eq. 90, text, pages 22-26",
    "accelerations are C A^2 G B",
    off(C @ Ab @ Ab @ G @ Bb, direct),
    "accelerations are C A^2 G B + C A B",
    off(C @ Ab @ Ab @ G @ Bb + C @ Ab @ Bb, direct),
)
force = np.random.default_rng(2).standard_normal((60, m))
x, y = np.zeros(n), []
for u in force:
    y.append(C @ x)
    x = A @ x + B @ u


def convolved(delay):
    return [sum((Y[k] @ force[t - k - delay] for k in range(t - delay + 1)), np.zeros(l)) for t in range(60)]


erratum(
    "Eq. 78, pages 22-26",
    "y(t) = sum Y(k) u(t-k)",
    off(convolved(0), y),
    "y(t) = sum Y(k-1) u(t-k)",
    off(convolved(1), y),
)

# %%
# Section III-2. The factor G of a record of N + 1 samples, and complex matrices: transposed and conjugated, parts side by side.
N, z = 127, np.exp(1j * w * s.dt)
GN = s.dt * sum(np.linalg.matrix_power(A, k) * z**-k for k in range(N + 1))
short = np.eye(n) - np.linalg.matrix_power(A, N + 1) * z ** -(N + 1)
erratum(
    "Eq. 88, text, pages 22-26",
    "G^-1 = jw I - ln A / dt",
    off((1j * w * np.eye(n) - Ab) @ GN, np.eye(n)),
    "G^-1 = (I - A/z) (I - (A/z)^(N+1))^-1 / dt",
    off((np.eye(n) - A / z) @ np.linalg.inv(short) @ GN / s.dt, np.eye(n)),
)
lines = np.exp(2j * np.pi * np.linspace(0.3, 8, 40) * s.dt)
blocks = [np.linalg.inv(v * np.eye(n) - A) @ B for v in lines]
Hg0, Hg1 = (V @ Ak @ np.hstack(blocks) for Ak in (np.eye(n), A))
both = [np.vstack([Hg0.real, Hg0.imag]), np.hstack([Hg0.real, Hg0.imag])]
rank = [int(np.linalg.matrix_rank(each, tol=1e-10 * np.linalg.norm(each, 2))) for each in both]
erratum(
    "Eq. 88, text, pages 22-26",
    "real and imaginary parts in consecutive rows: rank beyond n",
    rank[0] - n,
    "in consecutive columns: rank beyond n",
    rank[1] - n,
)
U, e, Z = np.linalg.svd(Hg0, full_matrices=False)
U, e, Z = U[:, :n], np.sqrt(e[:n]), Z[:n].conj().T
Ag = U.conj().T @ Hg1 @ Z / np.outer(e, e)
third = U.conj().T @ V @ power[3] @ np.hstack(blocks) @ Z / np.outer(e, e)
erratum(
    "Eq. 87, pages 22-26",
    "the bracket without its exponent k",
    off(Ag, third),
    "the bracket to the power k",
    off(np.linalg.matrix_power(Ag, 3), third),
)
differentiated = [np.linalg.inv(1j * v * np.eye(n) - Ab) @ Bb for v in 2 * np.pi * np.linspace(0.3, 8, 40)]
scale = 2 * np.pi * 8
Vc = np.vstack([C, C @ Ab / scale, C @ Ab @ Ab / scale**2])
Hc0, Hc1 = (Vc @ Ak @ np.hstack(differentiated) for Ak in (np.eye(n), Ab))
U, e, Z = np.linalg.svd(np.hstack([Hc0.real, Hc0.imag]), full_matrices=False)
Ac = U[:, :n].T @ np.hstack([Hc1.real, Hc1.imag]) @ Z[:n].T / e[:n]
true = np.linalg.eigvals(Ab)
far = [
    abs(np.linalg.eigvals(each)[:, None] - true).min(axis=1).max() / abs(true).max() for each in (np.linalg.inv(Ac), Ac)
]
erratum("Eq. 94, pages 22-26", "A = [...]^-1", far[0], "A = [...]", far[1])

# %%
# Section III-3. The null space of complex data is conjugated.
U, _, Z = np.linalg.svd(Hg0)
norm = np.linalg.norm(Hg0)
erratum(
    "Eqs. 97 and 98, pages 26-29",
    "P_n^T H Q_o = 0",
    np.linalg.norm(U[:, :n].T @ Hg0 @ Z.T[:, n:]) / norm,
    "P_n^* H Q_o = 0",
    np.linalg.norm(U[:, :n].conj().T @ Hg0 @ Z.conj().T[:, n:]) / norm,
)
everywhere = s.state_space(outputs=s.dofs)
sums = np.tri(s.degrees)  # each sensor measures the sum of the masses up to its own
seen = sums @ everywhere.C
below = -np.linalg.lstsq(np.vstack([seen, seen @ Ab]).T, (seen @ Ab @ Ab).T, rcond=None)[0].T[:, : s.degrees]
over_mass = np.linalg.solve(s.mass, s.stiffness)
erratum(
    "Eq. 107, pages 26-29",
    "M^-1 K = P of any sensors",
    off(below, over_mass),
    "M^-1 K = C_d^-1 P C_d",
    off(np.linalg.solve(sums, below @ sums), over_mass),
)
velocities = s.state_space(outputs=s.dofs, quantity="velocity").C
erratum(
    "Eq. 108, text, pages 26-29",
    "displacements at every mass: states without a sensor",
    n - np.linalg.matrix_rank(everywhere.C),
    "displacements and velocities: states without a sensor",
    n - np.linalg.matrix_rank(np.vstack([everywhere.C, velocities])),
)

# %%
# Section III-4. The outputs are the first block row of the factor.
U, e, Z = np.linalg.svd(Hg0, full_matrices=False)
U, e, Z = U[:, :n], np.sqrt(e[:n]), Z[:n]
Aa = np.linalg.pinv(U[:-l]) @ U[l:] * e / e[:, None]
Ba = (lines[0] * np.eye(n) - Aa) @ (e[:, None] * Z[:, :m])
given = np.hstack([C @ each for each in blocks])


def responses(output):
    return np.hstack([output @ np.linalg.solve(v * np.eye(n) - Aa, Ba) for v in lines])


erratum(
    "Eq. 110, pages 29-31",
    "C = E P D^1/2 without its last rows",
    off(responses((U * e)[:-l]), given),
    "C is the first block row of P D^1/2",
    off(responses((U * e)[:l]), given),
)

# %%
# One of them drawn: poles by Eq. 57 with the text's first and last exchanged are those of a structure that gains energy.
swapped = np.log(np.linalg.eigvals(np.linalg.pinv(Pn[l:]) @ Pn[:-l]).astype(complex)) / s.dt

figure, ax = pyplot.subplots(layout="constrained")
for each, mark, name in ((np.log(poles.astype(complex)) / s.dt, "o", "corrected"), (swapped, "x", "as printed")):
    ax.plot(each.real, each.imag / 2 / np.pi, mark, label=name)
ax.set_xlabel("real part, 1/s: positive grows")
ax.set_ylabel("frequency, Hz")
ax.legend()
