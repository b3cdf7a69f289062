"""
Compare methods on the same data
================================

Every method identifies the same response; they agree on all modes, whose grades are those of ``ms.analyze``. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

import modalscope as ms

data = ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)
c = ms.compare(data, ["era", "ssi-cov", "polyreference/time", "prce"], orders=range(2, 25, 2), workers=1)
print(c.verdict)
ms.plot.deviations(c)
