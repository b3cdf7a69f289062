"""
Identify free decays
====================

The structure is released from a displacement, without a measured force. Ibrahim's method and others identify it. Simulated.
"""

import modalscope as ms

decay = ms.systems.chain5().free_decay(400, displacement=[1, 0, 0.5, 0, -1])
decay = ms.systems.add_noise(decay, 0.01, seed=0)
diagram = ms.stabilize(decay, method="itd", orders=range(2, 25, 2))
modes = ms.select(diagram)
print(modes.table())
ms.plot.stabilization(diagram, modes)
