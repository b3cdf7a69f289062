"""
Tune a sine test: appropriated forces
=====================================

Which frequencies and which pattern of forces drive one mode alone. Simulated.
"""

import numpy as np

import modalscope as ms

structure = ms.systems.chain5()
frf = structure.frequency_response(np.linspace(0.3, 8, 1200), quantity="acceleration")
dwell = ms.tuned_dwell(frf)
print(dwell.modes.table())
print(dwell.forces.round(2))
ms.plot.indicator(frf, structure.modes(quantity="acceleration"))
