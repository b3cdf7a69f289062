"""
Choose the data matrix yourself
===============================

Eq. 20 of the report allows any rows of the Hankel matrix, not only neighbours. In a shell, with the expert options of ``identify``::

    modalscope identify decay.npz --method era --row-shifts 0,1,2,4,8,16 --block-columns 60

``--block-rows``, ``--column-shifts``, ``--form``, ``--source``, ``--weighting`` and ``--factorization`` are the others. Simulated.
"""

import modalscope as ms

data = ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)
even = ms.identify(data, method="era", order=10, block_rows=20)
uneven = ms.identify(data, method="era", order=10, row_shifts=[0, 1, 2, 4, 8, 16, 32], block_columns=60)
print(even.modes.frequencies.round(3))
print(uneven.modes.frequencies.round(3))

# %%
# Few rows that span a long time see slow modes as well as many rows: singular values of the uneven matrix.
ms.plot.singular_values(uneven, order=10)
