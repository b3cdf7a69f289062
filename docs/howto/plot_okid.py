"""
Come from records to Markov parameters: OKID
============================================

An observer computes them from records with any inputs, and ERA identifies them. Simulated.
"""

import modalscope as ms

record = ms.systems.chain5().simulate(duration=60.0, noise=0.01)
markov = ms.estimate_markov(record, samples=300)
found = ms.identify(markov, method="era", order=10)
print(found.modes.table())
ms.plot.response(markov, found)
