"""
Come to mass, damping and stiffness
===================================

Sensors at every mass, as many modes: M^-1 K and M^-1 D from the responses (Eqs. 102-109). Simulated.
"""

import numpy as np

import modalscope as ms

structure = ms.systems.three_masses()
data = structure.frequency_response(np.linspace(0.05, 3, 400) * structure.modes().frequencies.max() / 2)
found = ms.identify(data, method="polyreference", domain="s", order=6, block_rows=2)
equations = ms.equations_of_motion(found.state_space)
print(np.round(equations.stiffness.real, 4))
print(np.round(np.linalg.solve(structure.mass, structure.stiffness), 4))
ms.plot.response(data, found)
