"""
Follow a diagram order by order
===============================

For programs that draw while they compute, or stop early. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

from matplotlib import pyplot

import modalscope as ms

for cut in ms.sweep(ms.systems.chain5().impulse_response(300, noise=0.01), orders=range(2, 21, 2)):
    pyplot.plot(cut.modes.frequencies, [cut.order] * len(cut.modes), "k.")
print(cut.modes.frequencies.round(3))
pyplot.xlabel("frequency [Hz]")
pyplot.ylabel("model order (states)")
