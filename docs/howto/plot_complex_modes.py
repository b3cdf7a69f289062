"""
Look at a complex mode
======================

Arrows in line are in phase or in opposition; a fan is a complex mode. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import modalscope as ms

modes = ms.systems.chain5().modes()
print(ms.indicators.mpc(modes.shapes).round(4))
ms.plot.complexity(modes, 4)
