"""
Write modes for other programs
==============================

Universal files, MATLAB, tables, JSON: by the suffix, and back. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import modalscope as ms

modes = ms.analyze(ms.systems.chain5().impulse_response(300, noise=0.01)).modes
for name in ("modes.uff", "modes.mat", "modes.csv", "modes.json"):
    ms.write(name, modes)
again = ms.read("modes.uff")
print((again.frequencies / modes.frequencies).round(4), ms.mac(modes, again).diagonal().round(6))
ms.plot.mac(modes, again)
