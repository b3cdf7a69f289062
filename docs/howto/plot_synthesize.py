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
print(f"at {fine.frequencies[500]:.4f} Hz: {abs(fine.values[500, 3, 1]):.5e}")
ms.plot.response(fine, modes, output=3, input=1)
