"""
A hammer test
=============

**Measured**: a beam with seven accelerometers, hit at six points, in a universal file
(MIT, the authors of sdypy-EMA). In a shell the whole job is two lines::

    modalscope info examples/beam_hammer/beam_hammer.uff
    modalscope identify examples/beam_hammer/beam_hammer.uff --band 100 1700 -o report.html

This page does the same in Python, step by step.
"""

import modalscope as ms

# %%
# What is in the file
# -------------------
# ``read`` returns responses or records, depending on the file.
data = ms.datasets.load("beam_hammer")
print(data)
ms.plot.response(data.band(100, 1700))

# %%
# The modes
# ---------
# Only the band of interest is set. Each mode has its reasons and a 95 % interval. The interval covers the noise or the
# disagreement of the hammer points, whichever is larger.
result = ms.analyze(data, band=(100, 1700), orders=range(2, 41, 2))
print(result.modes.table())
for mode, interval in zip(result.modes, result.modes.interval(0.95)["frequency"], strict=True):
    print(f"{mode.frequency:8.2f} Hz, 95 %: {interval[0]:.2f} to {interval[1]:.2f}; {mode.reason['text']}")

# %%
# The authors of the data published 177.0, 477.4, 933.1 and 1535.5 Hz. The stabilization diagram
# shows how stable the poles are over model orders:
ms.plot.stabilization(result.diagram, result.modes)

# %%
# Do the modes explain what was measured?
# ---------------------------------------
ms.plot.response(result.diagram.response, result.modes)

# %%
# A report to send
# ----------------
# One file with pictures, grades, reasons, settings, and the script that repeats it.
ms.report(result, "report.html")

# %%
# What was left out, and why:
for each in result.modes.left_out:
    print(each)
