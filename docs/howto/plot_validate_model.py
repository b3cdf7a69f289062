"""
Validate a model on another record
==================================

A model is fitted to one record and simulates another that it has never seen. In a shell::

    modalscope realize first.npz -o model.npz
    modalscope validate model.npz second.npz -o fit.svg
"""

import matplotlib.pyplot as plt
import numpy as np

import modalscope as ms

chain = ms.systems.chain5()
first = chain.simulate(duration=60.0, noise=0.05, seed=1)
second = chain.simulate(duration=30.0, noise=0.05, seed=2)

model = ms.realize(first)
print(model)

# %%
# ``free_run`` is the share of the variance that the model simulates from the forces alone, in per cent for each output; ``one_step`` is predicted
# from the samples before. White residuals hold nothing that a better model could predict.
seen = ms.validate(model, second)
print(seen.table_of_outputs())

time = np.arange(300) / second.sampling_rate
axes = plt.subplots()[1]
axes.plot(time, second.outputs[:300, -1], label="measured")
axes.plot(time, model.simulate(second.inputs)[:300, -1], "--", label="simulated")
axes.set(xlabel="time [s]", ylabel=second.output_dofs[-1])
axes.legend()
