"""
Find a sensor that was turned round
===================================

A channel of the wrong sign violates the symmetry of driving points, and is named. Simulated, with one sign wrong.
"""

import numpy as np

import modalscope as ms

data = ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 800), quantity="acceleration", noise=0.01)
turned = np.array(data.values)
turned[:, 1] *= -1
spoiled = ms.FrequencyResponse(
    values=turned,
    frequencies=data.frequencies,
    quantity="acceleration",
    output_dofs=data.output_dofs,
    input_dofs=data.input_dofs,
)
for finding in ms.preprocess.examine(spoiled):
    print(finding)
ms.plot.response(spoiled, output=1)
