"""
Leave a bad hammer hit out
==========================

Measured (MIT, pyFRF): five hits; the first is overloaded, and this is detected.
"""

import modalscope as ms

hits = ms.datasets.load("impact_hits")
for finding in ms.preprocess.examine(hits):
    print(finding)

# %%
# Responses of the good hits alone (the default), and of all of them: the coherence tells.
good = ms.estimate_frf(hits).band(300, 1500)
spoiled = ms.estimate_frf(hits, hits="all").band(300, 1500)
print(f"mean coherence: good hits {good.coherence.mean():.3f}, all hits {spoiled.coherence.mean():.3f}")
ms.plot.response(good)
