"""
Ambient vibration
=================

**Measured**: an eight-storey timber building in the wind, three points of its roof, 45 minutes (MIT, pyOMA2). In a shell::

    modalscope psd palisaden.npz -o spectra.png
    modalscope identify palisaden.npz --band 1 4 --geometry points.csv --lines lines.csv -o report.html
"""

import modalscope as ms

folder = ms.datasets.folder("palisaden")  # or your own
record = ms.read(folder / "palisaden.npz", geometry=(folder / "points.csv", folder / "lines.csv"))
print(record)

# %%
# A first look
# ------------
# Peaks of the first singular value of the spectra are modes (frequency-domain decomposition).
spectra = ms.preprocess.decomposition(record)
ms.plot.spectra(spectra, peaks=4).set_xlim(0, 5)

# %%
# The modes
# ---------
# The sensors drift below 1 Hz, so a band is given. Forces were not measured, so correlations take the place of responses (SSI-cov).
result = ms.analyze(record, band=(1.0, 4.0))
print(result.modes.table())
ms.plot.stabilization(result.diagram, result.modes, spectra=spectra)

# %%
# Published by the authors: 1.882, 2.422 and 2.687 Hz. The first mode on the building:
ms.plot.shape(result.modes, 0)

# %%
# Damping of ambient data is uncertain. The intervals show how much:
ms.plot.intervals(result.modes, of="damping")
