"""
Fit residues to known poles
===========================

Poles from one test, shapes from all its responses: least squares on the lines. Simulated.
"""

import numpy as np

import modalscope as ms

structure = ms.systems.chain5()
data = structure.frequency_response(np.linspace(0.5, 5, 600), quantity="acceleration", noise=0.01)
poles = ms.analyze(data.select(inputs=[0])).modes
modes = ms.fit_residues(data, poles)
print(modes)
ms.plot.response(data, modes)
