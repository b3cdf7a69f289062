"""
Merge setups that share references
==================================

A few sensors stay, others rove: one model of all points. Simulated ambient records of two setups.
"""

import modalscope as ms

structure = ms.systems.spring_chain(6)
setups = [
    structure.simulate(inputs="ambient", outputs=outputs, duration=400.0, sampling_rate=20.0, noise=0.01, seed=seed)
    for seed, outputs in enumerate(([0, 5, 1, 2], [0, 5, 3, 4]))
]
result = ms.analyze(ms.merge(setups))
print(result.modes.table())
ms.plot.shape(result.modes, 1)
