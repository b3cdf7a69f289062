"""
Animate a mode shape
====================

Each frame shows the shape times the cosine of the phase. Here are four frames. Simulated: a frame of four storeys
(``ms.systems.iasc_asce``). ``ms.plot.animate`` writes a file that moves.
"""

import numpy as np
from matplotlib import pyplot

import modalscope as ms

modes = ms.systems.iasc_asce().modes()
print(f"the mode at {modes.frequencies[1]:.2f} Hz")
figure, axes = pyplot.subplots(2, 2, figsize=(9, 9), layout="constrained")
for ax, phase in zip(axes.flat, (0, 60, 120, 180), strict=True):
    ms.plot.shape(modes, 1, ax=ax, scale=0.14 * np.cos(np.radians(phase)))
    ax.set_title(f"{phase}°", loc="left")
