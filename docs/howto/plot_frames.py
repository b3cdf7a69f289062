"""
Take a pandas table, give one back
==================================

Names, units and the rate of the index are kept. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import pandas as pd

import modalscope as ms

record = ms.systems.chain5().simulate(inputs="ambient", duration=600.0, noise=0.01)
index = pd.Index([k / record.sampling_rate for k in range(record.samples)], name="time [s]")
frame = pd.DataFrame(record.outputs, index=index, columns=["a1 [m/s^2]", "a2 [m/s^2]", "a3 [m/s^2]", "a4 [m/s^2]"])
result = ms.analyze(frame)
print(result.modes.to_dataframe().iloc[:, :3])
ms.plot.stabilization(result.diagram, result.modes)
