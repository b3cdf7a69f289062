"""
Use several runs of one test
============================

Runs are averaged or put side by side; their disagreement is the repeatability of the test. Simulated.
"""

import modalscope as ms

record = ms.systems.chain5().simulate(duration=40.0, runs=4, noise=0.03)
result = ms.analyze(record)
print(result.modes.table())
print(result.modes.frequencies_repeatability)
ms.plot.intervals(result.modes)
