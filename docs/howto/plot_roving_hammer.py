"""
Identify a roving hammer
========================

One accelerometer stays, the hammer goes from point to point: a file a point. In a shell, where files do not name their points::

    modalscope identify point_*.uff --input-dofs 1:+X 2:+X 3:+X 4:+X -o report.html

Responses with more hammer points than sensors are exchanged by reciprocity, so that the shapes lie over the hammer points.
"""

from dataclasses import replace

import numpy as np

import modalscope as ms

chain = ms.systems.chain5()
lines = np.linspace(0.2, 8, 400)
files = []
for point in range(4):  # what the four files hold, with the accelerometer at the first mass
    frf = chain.frequency_response(lines, inputs=[point], quantity="acceleration", noise=0.02, seed=point)
    files.append(replace(frf.select(outputs=[0]), input_dofs=[f"{point + 1}:+X"]))

# %%
data = ms.merge(files)
result = ms.analyze(data)
print(data)
print(result.modes.table())

# %%
# The third shape over the four hammer points:
ms.plot.shape(result.modes, 2)
