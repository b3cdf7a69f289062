"""
Draw shapes on the structure
============================

A geometry comes with the data, from a table of points, or is made here. Simulated: ``ms.systems.iasc_asce``, a frame of four storeys.
"""

import modalscope as ms

modes = ms.systems.iasc_asce().modes()
print(modes.frequencies[:4].round(2))
ms.plot.shape(modes, 2)
