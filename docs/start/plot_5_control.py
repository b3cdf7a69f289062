"""
A model for control
===================

**Simulated** by ``ms.systems``: a chain of five masses with one force. A state-space model is identified from its responses, and a
regulator adds damping. With a file of your own::

    modalscope realize test.uff --order 10 -o model.mat
"""

import numpy as np
import scipy.linalg

import modalscope as ms

structure = ms.systems.chain5()
measured = structure.impulse_response(300, inputs=[0], quantity="velocity", noise=0.01, seed=3)

# %%
# From responses to A, B, C
# -------------------------
# The eigensystem realization algorithm, gives a balanced model. The singular values show how many states stand out of the noise.
found = ms.identify(measured, method="era", order=10)
ms.plot.singular_values(found, order=10)

# %%
model = found.state_space
print(model)
print(f"unexplained: {100 * found.fit_error:.2f} %")
ms.plot.response(measured, found)

# %%
# A regulator
# -----------
# The model gives arrays (``model.A``), and objects of scipy (``model.to_scipy()``) and of python-control (``model.to_control()``).
A, B = model.A, model.B
P = scipy.linalg.solve_discrete_are(A, B, model.C.T @ model.C, 1e-4 * np.eye(B.shape[1]))
gain = np.linalg.solve(1e-4 * np.eye(B.shape[1]) + B.T @ P @ B, B.T @ P @ A)
closed = ms.StateSpace(A=A - B @ gain, B=B, C=model.C, D=model.D, dt=model.dt)
for name, which in (("open", model), ("closed", closed)):
    s = np.log(which.poles.astype(complex)) / which.dt
    print(f"{name:6s} least damping {min(-s.real / abs(s)):.4f}")

# %%
# The response of the closed loop decays faster:
from matplotlib import pyplot

_, axes = pyplot.subplots()
for name, which in (("open loop", model), ("closed loop", closed)):
    response = which.impulse_response(200)
    axes.plot(np.arange(200) * which.dt, response.values[:200, 0, 0], label=name)
axes.set(xlabel="time [s]", ylabel="velocity, first mass [(m/s)/N]")
axes.legend()
