"""
Identify sixty files, one setting for all
=========================================

Sixty records of one structure, a file each, identified alone with the same choices. In a shell, with the choices in a file::

    modalscope identify run_*.csv --each --config options.toml -o modes.json

``options.toml`` holds one table a command: ``[identify]`` and below it ``band = [0.3, 8]``. Six records here; ``modalscope watch`` follows months of them.
"""

import matplotlib.pyplot as plt

import modalscope as ms

chain = ms.systems.chain5()
choices = {"band": (0.3, 8.0), "refine": False}

found = []
for run in range(6):
    record = chain.simulate(inputs="ambient", duration=900.0, noise=0.05, seed=run)
    found.append(ms.analyze(record, **choices).modes)

# %%
# The first mode with its interval, over the records. ``ms.same_mode`` says whether two lines are one mode.
print(ms.same_mode(found[0][0], found[1][0]).text)

axes = plt.subplots()[1]
for run, modes in enumerate(found):
    low, high = modes.interval(0.95)["frequency"][0]
    axes.errorbar(run, modes.frequencies[0], yerr=(high - low) / 2, fmt="o", color="tab:blue", capsize=3)
axes.set(xlabel="record", ylabel="first frequency [Hz], 95 %")
