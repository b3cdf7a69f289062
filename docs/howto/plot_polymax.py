"""
Use PolyMAX, or any row of the table
====================================

Methods go by any of their names. Measured: the beam of the start page.
"""

import modalscope as ms

data = ms.datasets.load("beam_hammer")
diagram = ms.stabilize(data, method="polymax", band=(100, 1700), orders=range(2, 21))
modes = ms.select(diagram)
print(modes.table())
ms.plot.stabilization(diagram, modes)
