"""
All identities on measured data
===============================

**Measured**: the hammered beam of the start page. These relations hold with noise, on any data, to rounding; each residual comes from two
separate routes. ``ms.compare`` checks them on your own data.
"""

import numpy as np
from matplotlib import pyplot

import modalscope as ms
from modalscope.analysis.comparing.identities import check_identities

data = ms.datasets.load("beam_hammer").band(100, 1700)
found = [i for i in check_identities(data, 16) if np.isfinite(i.residual)]
for i in found:
    print(f"{i.name}, {i.source}, in {i.domain}: {i.residual:.1e} (at most 1e-9)")

# %%
figure, ax = pyplot.subplots(figsize=(10, 0.42 * len(found) + 1.2), layout="constrained")
ax.barh([f"{i.name} ({i.domain})" for i in found], [max(i.residual, 1e-17) for i in found], color="#0072B2")
ax.set_xscale("log")
ax.set_xlim(1e-17, 1)
ax.invert_yaxis()
ax.set_xlabel("residual: 1e-16 is rounding, 1 would be another method")
