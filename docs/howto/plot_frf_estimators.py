"""
Choose H1, H2 or Hv
===================

H1 is right with noise on the outputs, H2 with noise on the inputs, Hv with both. Simulated, with noise on both.
"""

from matplotlib import pyplot

import modalscope as ms

structure = ms.systems.chain5()
record = structure.simulate(duration=600.0, at=[0], noise=0.05, input_noise=0.05)
exact = structure.frequency_response(ms.estimate_frf(record).frequencies[1:], inputs=[0], quantity="acceleration")
for estimator in ("h1", "h2", "hv"):
    frf = ms.estimate_frf(record, estimator=estimator)
    pyplot.semilogy(frf.frequencies, abs(frf.values[:, 0, 0]), lw=0.8, label=estimator)
pyplot.semilogy(exact.frequencies, abs(exact.values[:, 0, 0]), "k:", lw=1, label="exact")
pyplot.xlabel("frequency [Hz]")
pyplot.ylabel("accelerance [(m/s²)/N]")
pyplot.legend()
