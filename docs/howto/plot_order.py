"""
See which order the data carry
==============================

Singular values of the data matrix, and what every order leaves unexplained. Simulated: a chain of five masses (``ms.systems.chain5``).
"""

from matplotlib import pyplot

import modalscope as ms

diagram = ms.stabilize(ms.systems.chain5().impulse_response(300, noise=0.01), orders=range(2, 31, 2))
print(f"order 10 leaves {100 * diagram.fit_errors[diagram.orders.index(10)]:.2f} % unexplained; the noise is 1 %")
figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4))
ms.plot.singular_values(diagram.singular_values[:40], left, order=10)
ms.plot.fit_errors(diagram, right)
