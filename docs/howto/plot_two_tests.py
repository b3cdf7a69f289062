"""
Compare two tests of one structure
==================================

Pairs of modes by frequency and shape; what changed. Simulated: a frame with and without braces.
"""

import modalscope as ms

sound = ms.systems.iasc_asce().modes()
damaged = ms.systems.iasc_asce(without_braces=[1]).modes()
pairs = ms.pair_modes(sound, damaged, tolerance=0.5)
print((100 * pairs.frequency_change).round(2), "% of change")
ms.plot.mac(pairs.a, pairs.b)
