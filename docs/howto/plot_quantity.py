"""
Convert the quantity of a record
================================

Accelerations to velocities and back, exactly on lines. Simulated.
"""

from matplotlib import pyplot

import modalscope as ms

record = ms.systems.chain5().simulate(duration=60.0)
velocity = ms.preprocess.integrate(record)
t = [k / record.sampling_rate for k in range(400)]
pyplot.plot(t, record.outputs[:400, 0], label="acceleration [m/s²]")
pyplot.plot(t, velocity.outputs[:400, 0], label="velocity [m/s]")
pyplot.xlabel("time [s]")
pyplot.legend()
