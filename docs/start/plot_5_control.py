"""
A model for control
===================

**Simulated** by ``ms.systems``: a chain of five masses, one measured force, 60 s of velocities with 5 % noise. A state-space model is identified
from the record, tried on a part of it that it was not fitted to, and given a regulator that adds damping. With a file of your own::

    modalscope realize test.mat -o model.mat
"""

import numpy as np
import scipy.linalg

import modalscope as ms

structure = ms.systems.chain5()
record = structure.simulate(at=[0], duration=60.0, quantity="velocity", noise=0.05, seed=3)

# %%
# From a record to A, B, C, D
# ---------------------------
# Models of many orders are fitted to a part of the record; the one that simulates the rest best from the force alone is refined. What it explains of
# that rest is what a regulator can rely on.
model = ms.realize(record)
print(model)
print(model.validation)

# %%
# Measured outputs, and those that the model simulates from the force:
from matplotlib import pyplot

time = np.arange(400) / record.sampling_rate
simulated = model.simulate(record.inputs)
_, axes = pyplot.subplots()
axes.plot(time, record.outputs[:400, 0], label="measured")
axes.plot(time, simulated[:400, 0], "--", label="simulated from the force")
axes.set(xlabel="time [s]", ylabel="velocity, first mass [m/s]")
axes.legend()

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
_, axes = pyplot.subplots()
for name, which in (("open loop", model), ("closed loop", closed)):
    response = which.impulse_response(200)
    axes.plot(np.arange(200) * which.dt, response.values[:200, 0, 0], label=name)
axes.set(xlabel="time [s]", ylabel="velocity, first mass [(m/s)/N]")
axes.legend()
