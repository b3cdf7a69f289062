"""
Say how sure a value is
=======================

Standard deviations from the noise come with the modes; the interval of 95 % follows. Simulated: a chain of five masses
(``ms.systems.chain5``).
"""

import modalscope as ms

result = ms.analyze(ms.systems.chain5().impulse_response(300, noise=0.02, seed=4))
interval, true = result.modes.interval(0.95)["damping_ratio"], ms.systems.chain5().modes().damping_ratios
print(interval.round(5))
print("true:", true.round(5), "within:", (interval[:, 0] < true) & (true < interval[:, 1]))
ms.plot.intervals(result.modes, of="damping")
