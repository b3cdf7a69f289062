"""
Deflection shapes at orders of a rotation
=========================================

How a machine moves in phase with its shaft while the speed changes. Simulated: two orders, one pulse a turn. From a file:
``modalscope ods run.mat --order 1 2.5 --tacho pulses -o shapes.uff -o shapes.gif``.
"""

import numpy as np

import modalscope as ms

t = np.arange(4000) / 400.0
turns = 5 * t + 0.2 * t**2
first, second = np.array([[1.0, 0.8, 0.3], [0.2, -0.5, 0.6]])
y = np.cos(2 * np.pi * turns)[:, None] * first + np.sin(5 * np.pi * turns)[:, None] * second
pulses = np.interp(np.arange(int(turns[-1]) + 1), turns, t)
record = ms.Signals(outputs=y + 0.05 * np.random.default_rng(0).standard_normal(y.shape), sampling_rate=400.0)

shapes = ms.ods(record, order=[1, 2.5], tacho=pulses)
print(abs(shapes.shapes).round(2))
ms.plot.shape(shapes, 1)
