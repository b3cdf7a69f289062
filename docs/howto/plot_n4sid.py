"""
Identify records by subspaces: N4SID
====================================

Past inputs and outputs as instruments. Simulated, with forces that nobody measured.
"""

import modalscope as ms

record = ms.systems.chain5().simulate(duration=100.0, noise=0.02, process_noise=0.1)
diagram = ms.stabilize(record, method="n4sid", orders=range(2, 25, 2))
modes = ms.select(diagram)
print(modes.table())
ms.plot.stabilization(diagram, modes)
