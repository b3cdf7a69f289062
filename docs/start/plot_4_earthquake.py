"""
An earthquake record
====================

**Simulated** by ``ms.systems``: a building of five storeys on moving ground. The accelerometer in the basement is the input, those on
the floors are the outputs. The record is short and not stationary. With a file of your own, the basement's channel first::

    modalscope identify quake.csv --columns "time=1,in=2,out=3-7" -o report.html
"""

import numpy as np

import modalscope as ms

building = ms.systems.spring_chain(5, mass=2e5, stiffness=3e8, damping_ratio=0.03)
rate, seconds = 50.0, 40.0
t = np.arange(int(rate * seconds)) / rate
shaking = np.random.default_rng(7).standard_normal(t.size) * t * np.exp(-t / 4)  # m/s^2: rises and dies away

# %%
# On moving ground the force on every mass is -m a(t). A sensor on a floor measures the motion relative to the ground, and that of the ground.
forces = -np.diag(building.mass) * shaking[:, None]
relative = building.simulate(inputs=forces, at=building.dofs, sampling_rate=rate, quantity="acceleration")
floors = relative.outputs + shaking[:, None]
floors = floors + 0.01 * floors.std() * np.random.default_rng(8).standard_normal(floors.shape)
record = ms.Signals(outputs=floors, inputs=shaking[:, None], sampling_rate=rate, quantities="acceleration")
print(record)

# %%
# The modes of the building on fixed ground
# -----------------------------------------
result = ms.analyze(record)
print(result.modes.table())
print("true   [Hz]:", building.modes().frequencies.round(4))
ms.plot.stabilization(result.diagram, result.modes)

# %%
# The response of the roof to the ground, measured and synthesized:
ms.plot.response(result.diagram.response, result.modes, output=4)

# %%
ms.plot.intervals(result.modes, of="damping")
