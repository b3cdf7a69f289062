"""
Do an analysis again, exactly
=============================

The document of an analysis holds every choice; the result is the same to the last bit. Simulated: a chain of five masses
(``ms.systems.chain5``).
"""

import modalscope as ms

ms.write("test.npz", ms.systems.chain5().impulse_response(300, noise=0.01))
first = ms.analyze("test.npz", orders=range(2, 31, 2))
ms.write("test.analysis.json", first.analysis)
again = ms.replay("test.analysis.json")
print((again.modes.poles == first.modes.poles).all())
ms.plot.stabilization(again.diagram, again.modes)
