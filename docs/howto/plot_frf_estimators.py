"""
Choose H1, H2 or Hv
===================

H1 is right with noise on the outputs, H2 with noise on the inputs, Hv with the same share of noise on both. Simulated, with 30 % of noise on
force and sensors: H1 then shows 1 / (1 + 0.3²) = 0.917 of the response.
"""

import numpy as np
from matplotlib import pyplot

import modalscope as ms

structure = ms.systems.chain5()
record = structure.simulate(duration=6000.0, at=[0], noise=0.3, input_noise=0.3)
sampled = structure.state_space(dt=1 / record.sampling_rate, inputs=[0], quantity="acceleration")
for estimator in ("h1", "h2", "hv"):
    frf = ms.estimate_frf(record, estimator=estimator, segment=8192)
    exact = sampled.frequency_response(frf.frequencies[1:]).values
    share = (np.vdot(exact, frf.values[1:]) / np.vdot(exact, exact)).real
    print(f"{estimator}: {share:.4f} of the exact one")
    pyplot.semilogy(frf.frequencies, abs(frf.values[:, 0, 0]), lw=0.8, label=estimator)
pyplot.semilogy(frf.frequencies[1:], abs(exact[:, 0, 0]), "k:", lw=1, label="exact")
pyplot.xlabel("frequency [Hz]")
pyplot.ylabel("accelerance [(m/s²)/N]")
pyplot.legend()
