"""
A shaker test
=============

**Simulated** by ``ms.systems``: five masses in a row under two shakers with random forces, noise on every channel. With a file of your own::

    modalscope identify run1.mat --band 1 400 -o modes.json -o report.html
"""

import modalscope as ms

structure = ms.systems.chain5()
record = structure.simulate(duration=60.0, noise=0.02, seed=1)
print(record)

# %%
# Records without windows
# -----------------------
# The lines of the whole record are identified, without windows or averages. The inputs and the transients at both ends are
# eliminated exactly, so there is no leakage. See :doc:`/records-on-lines`.
result = ms.analyze(record)
print(result.modes.table())
ms.plot.stabilization(result.diagram, result.modes)

# %%
# Compared with the truth, which is known here:
truth = structure.modes()
pairs = ms.pair_modes(result.modes, truth)
print(f"largest error of a frequency {100 * abs(pairs.frequency_change).max():.3f} %, least MAC {pairs.mac.min():.4f}")
ms.plot.mac(pairs.a, pairs.b)

# %%
# Do the intervals hold?
# ----------------------
# ``certify`` simulates this test many times, with the identified modes as the truth and noise like that of the data, and identifies it.
certificate = ms.certify(result, replicates=12)
print(f"{certificate.holds.sum()} of {len(certificate.holds)} intervals hold")
ms.plot.certificate(certificate)
