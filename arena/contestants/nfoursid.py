"""nfoursid: N4SID of records with forces, the order given by a person, twice the number of modes."""

import numpy as np

REQUIRES = ("nfoursid==1.0.2", "matplotlib==3.11.2")  # it imports matplotlib, and does not say so
TAKES = ("records",)
SOURCE = "nfoursid, examples/Overview.ipynb: NFourSID(num_block_rows=10), subspace_identification(), order by its singular values"
VARIANTS = {"nfoursid": "N4SID of given order"}


def run(test, variant):
    """Identify."""
    import pandas as pd
    from child import CannotError, modes_of
    from nfoursid.nfoursid import NFourSID

    if test.outputs.ndim != 2:
        raise CannotError("one run at a time")
    order = 2 * test.human("modes")
    outputs, inputs = (
        [f"{name}{k}" for k in range(x.shape[1])] for name, x in (("y", test.outputs), ("u", test.inputs))
    )
    frame = pd.DataFrame(np.hstack([test.outputs, test.inputs]), columns=outputs + inputs)
    model = NFourSID(frame, output_columns=outputs, input_columns=inputs, num_block_rows=10)
    model.subspace_identification()
    found, _ = model.system_identification(rank=order)
    return modes_of(found.a, found.c, test.sampling_rate)
