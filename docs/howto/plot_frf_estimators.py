"""
Choose H1, H2 or Hv
===================

H1 is right with noise on the outputs, H2 with noise on the inputs, Hv with both. Simulated, with noise on both.
"""

import numpy as np
from matplotlib import pyplot

import modalscope as ms

structure = ms.systems.chain5()
record = structure.simulate(duration=600.0, at=[0], noise=0.05, input_noise=0.05)
sampled = structure.state_space(dt=1 / record.sampling_rate, inputs=[0], quantity="acceleration")
exact = sampled.frequency_response(ms.estimate_frf(record).frequencies[1:])
for estimator in ("h1", "h2", "hv"):
    frf = ms.estimate_frf(record, estimator=estimator)
    print(
        f"{estimator}: {(np.vdot(exact.values, frf.values[1:]) / np.vdot(exact.values, exact.values)).real:.4f} of the exact one"
    )
    pyplot.semilogy(frf.frequencies, abs(frf.values[:, 0, 0]), lw=0.8, label=estimator)
pyplot.semilogy(exact.frequencies, abs(exact.values[:, 0, 0]), "k:", lw=1, label="exact")
pyplot.xlabel("frequency [Hz]")
pyplot.ylabel("accelerance [(m/s²)/N]")
pyplot.legend()
