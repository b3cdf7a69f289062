"""
Identify ambient records directly: SSI-data
===========================================

Records are projected on their past, without correlations. Simulated.
"""

import modalscope as ms

record = ms.systems.chain5().simulate(inputs="ambient", duration=900.0, noise=0.02, seed=6)
diagram = ms.stabilize(record, method="ssi-data", orders=range(2, 31, 2))
modes = ms.select(diagram)
print(modes.table())
ms.plot.stabilization(diagram, modes, spectra=ms.preprocess.decomposition(record))
