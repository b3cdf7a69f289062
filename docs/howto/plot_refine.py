"""
Refine modes to the maximum of the likelihood
=============================================

``analyze`` does it automatically. Here it is done step by step and compared with the unrefined values. Simulated: a chain of five masses
(``ms.systems.chain5``).
"""

import modalscope as ms

data = ms.systems.chain5().impulse_response(200, noise=0.05, seed=5)
found = ms.select(ms.stabilize(data))
refined = ms.refine(data, found)
truth = ms.systems.chain5().modes()
for name, modes in (("before", found), ("refined", refined), ("true", truth)):
    print(f"{name:8s}", modes.damping_ratios.round(6))
ms.plot.intervals(refined, of="damping")
