"""
Identify a narrow band
======================

A band is cut out of responses; the modes outside are carried by residual terms. Measured: the beam.
"""

import modalscope as ms

data = ms.datasets.load("beam_hammer")
result = ms.analyze(data, band=(440, 520), orders=range(2, 21, 2))
print(result.modes.table())
ms.plot.response(result.diagram.response, result.modes)
