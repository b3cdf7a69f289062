"""
Pick modes by hand
==================

A diagram, and frequencies that you chose from it: nothing else is reported. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import modalscope as ms

data = ms.systems.chain5().impulse_response(300, noise=0.02, seed=1)
diagram = ms.stabilize(data)
modes = ms.select(diagram, frequencies=[0.906, 2.64, 4.17])
print(modes.table())
ms.plot.stabilization(diagram, modes)
