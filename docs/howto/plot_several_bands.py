"""
Identify several bands and merge them
=====================================

Each band has its own diagram; modes at a border are listed once. Measured: the beam.
"""

import modalscope as ms

data = ms.datasets.load("beam_hammer")
result = ms.analyze(data, band=[(100, 600), (600, 1700)], orders=range(2, 21, 2))
print(result.modes.table())
ms.plot.mac(result.modes)
