"""
Write a report to send
======================

One file: grades, pictures, reasons, settings, and the script that repeats it. Simulated: a chain of five masses
(``ms.systems.chain5``).
"""

from pathlib import Path

import modalscope as ms

result = ms.analyze(ms.systems.chain5().impulse_response(300, noise=0.01))
path = ms.report(result, "report.html", title="Five masses, simulated")
print(f"{Path(path).stat().st_size / 1024:.0f} kB, no request to anywhere")
ms.plot.mac(result.modes)
