"""
Prove that the intervals hold
=============================

Your own case is simulated and identified again: bias, scatter and coverage of each interval. Simulated: a chain of five masses
(``ms.systems.chain5``).
"""

import modalscope as ms

result = ms.analyze(ms.systems.chain5().impulse_response(200, noise=0.02, seed=4), orders=range(2, 25, 2))
certificate = ms.certify(result, replicates=10)
print(certificate.holds)
ms.plot.certificate(certificate, of="damping")
