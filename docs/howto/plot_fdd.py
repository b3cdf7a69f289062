"""
Look at ambient spectra: FDD
============================

Peaks of the first singular value of the spectra, and the shapes there. Measured: the building of the start page.
"""

import modalscope as ms

record = ms.datasets.load("palisaden")
spectra = ms.preprocess.decomposition(record)
frequencies, shapes = spectra.peaks(4)
print(frequencies.round(3))
ms.plot.spectra(spectra, peaks=4).set_xlim(0, 5)
