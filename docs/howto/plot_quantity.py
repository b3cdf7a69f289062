"""
Convert the quantity of a record
================================

Accelerations to velocities: every line is divided by its circular frequency, and the ends of the record are slightly wrong
(``integrate`` says how). Simulated.
"""

import numpy as np
from matplotlib import pyplot

import modalscope as ms

record = ms.systems.chain5().simulate(duration=60.0)
velocity = ms.preprocess.integrate(record)
ratio = np.abs(np.fft.rfft(record.outputs[:, 0])[158] / np.fft.rfft(velocity.outputs[:, 0])[158])
print(f"line 158, at {158 / 60:.4f} Hz: acceleration over velocity {ratio:.4f} rad/s")
t = np.arange(400) / record.sampling_rate
figure, (upper, lower) = pyplot.subplots(2, 1, sharex=True, layout="constrained")
upper.plot(t, record.outputs[:400, 0])
lower.plot(t, velocity.outputs[:400, 0])
upper.set_ylabel("acceleration [m/s²]")
lower.set_ylabel("velocity [m/s]")
lower.set_xlabel("time [s]")
