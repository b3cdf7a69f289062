"""
Use arrays that are already there
=================================

Arrays need no file: say what they are. Axes are lines or samples, then outputs, then inputs.
"""

import numpy as np

import modalscope as ms

f = np.linspace(0.3, 8.0, 800)
H = (
    ms.systems.chain5().frequency_response(f, quantity="acceleration", noise=0.02).values
)  # any complex array (lines, outputs, inputs)
frf = ms.FrequencyResponse(values=H, frequencies=f, quantity="acceleration", units=("m/s^2", "N"))
result = ms.analyze(frf)
print(result.modes.table())
ms.plot.stabilization(result.diagram, result.modes)
