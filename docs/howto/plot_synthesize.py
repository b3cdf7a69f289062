"""
Predict responses from modes
============================

A modal model gives the response on any lines or samples. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import numpy as np

import modalscope as ms

modes = ms.systems.chain5().modes()
fine = modes.frequency_response(np.linspace(0.2, 8, 2000))
print(fine)
ms.plot.response(fine, modes, output=3, input=1)
