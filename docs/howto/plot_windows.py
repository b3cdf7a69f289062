"""
Take an exponential window out again
====================================

An exponential window lets lightly damped responses die away before the record ends; it adds the same decay to every pole, and it is
taken off the result by itself. Measured (MIT, pyFRF): four good hits, with and without the window.
"""

import modalscope as ms

hits = ms.datasets.load("impact_hits")
for exponential in (None, 0.05):  # what the window leaves at the end of a record
    frf = ms.estimate_frf(hits, exponential=exponential, force_window=0.02 if exponential else None)
    modes = ms.analyze(frf, band=(400, 900), orders=range(2, 31, 2)).modes
    print(exponential, modes.frequencies.round(1), (100 * modes.damping_ratios).round(3))
ms.plot.response(frf.band(400, 900), modes)
