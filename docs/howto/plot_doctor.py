"""
Have the data examined
======================

Overloads, swapped signs, dead channels, drift, missing quantities: what was detected, and what to change. Simulated, with faults.
"""

import numpy as np
from matplotlib import pyplot

import modalscope as ms

record = ms.systems.chain5().simulate(duration=60.0, noise=0.01)
spoiled = np.array(record.outputs)
spoiled[:, 2] = np.clip(spoiled[:, 2], *np.quantile(spoiled[:, 2], [0.1, 0.9]))
for finding in ms.preprocess.examine(
    ms.Signals(outputs=spoiled, inputs=record.inputs, sampling_rate=record.sampling_rate)
):
    print(finding)
t = np.arange(300) / record.sampling_rate
pyplot.plot(t, record.outputs[:300, 2], lw=0.8, label="y3 as it was")
pyplot.plot(t, spoiled[:300, 2], label="y3 as recorded")
pyplot.xlabel("time [s]")
pyplot.ylabel("acceleration [m/s²]")
pyplot.legend()
