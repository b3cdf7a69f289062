"""
Tell two close modes apart
==========================

Two pairs, 2.8 and 0.16 per cent apart: two references are needed, and the second singular value shows them (``ms.systems.close4``).
"""

import modalscope as ms

structure = ms.systems.close4()
data = structure.impulse_response(600, noise=0.002, seed=2)
result = ms.analyze(data)
print(result.modes.table())
print("true [Hz]:", structure.modes().frequencies.round(4))
ms.plot.indicator(data.to_frequency_response(), result.modes)
