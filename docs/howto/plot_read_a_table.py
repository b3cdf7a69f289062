"""
Read a table of columns
=======================

A .csv as a logger writes it: names, a row of units, and times. ``modalscope info table.csv`` shows how it was read.
"""

import numpy as np

import modalscope as ms

record = ms.systems.chain5().simulate(duration=30.0, noise=0.01)
table = np.column_stack([np.arange(record.samples) / record.sampling_rate, record.inputs[:, 0], record.outputs])
head = "time,force,acc1,acc2,acc3,acc4\ns,N,m/s^2,m/s^2,m/s^2,m/s^2"
np.savetxt("table.csv", table, delimiter=",", header=head, comments="", fmt="%.7g")

# %%
data = ms.read("table.csv")
print(data)
ms.plot.spectra(ms.preprocess.decomposition(data), peaks=5)
