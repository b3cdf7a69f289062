"""
Scale shapes to unit modal mass
===============================

Driving points give the modal mass. Simulated: the result is compared with the exact one.
"""

import numpy as np

import modalscope as ms

structure = ms.systems.spring_chain(3)
f = np.linspace(0.3, 6, 800)
data = structure.frequency_response(f, quantity="acceleration", noise=0.01)
modes = ms.analyze(data).modes.normalized("mass")
print(abs(modes.shapes).round(4))
print(abs(structure.modes().normalized("mass").shapes).round(4))
ms.plot.shape(modes, 0)
