"""
Add a mode to the automatic ones, or refuse one
===============================================

Every candidate that was left out is listed, with the option that adds it. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import modalscope as ms

data = ms.systems.chain5().impulse_response(300, noise=0.02, seed=1)
result = ms.analyze(data, refuse=[5.36])
for each in result.modes.left_out[-3:]:
    print(each)
print(result.modes.table())
ms.plot.stabilization(result.diagram, result.modes)
