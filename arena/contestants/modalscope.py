"""modalscope, hands off: the whole job, nothing set but the band that everybody is given.

And one row of its table at a time: a diagram by that method alone, and the choice of modes from it, without refinement.
"""

import numpy as np

REQUIRES = ()
TAKES = ("responses", "impulses", "records", "ambient", "decay", "earthquake", "setups", "months")
SOURCE = "README: ms.analyze(data); rows: docs/methods: ms.stabilize(data, method=...), ms.select"
VARIANTS = {
    "modalscope": "the whole job, hands off",
    "row era": "balanced projection",
    "row polyreference": "null space, companion form",
    "row lscf": "matrix fraction of responses",
    "row ssi-data": "projected ambient records",
}
#: The kinds that a row is made for, where it is not all four.
ROWS = {"lscf": ("responses",), "ssi-data": ("ambient",)}


def data_of(test):
    """Return the test as a data class of modalscope."""
    import modalscope as ms

    rate = test.sampling_rate
    if test.kind == "responses":
        f, lines = test.frequencies, test.frequencies > 0
        return ms.FrequencyResponse(values=test.values[lines], frequencies=f[lines], quantity=test.quantity)
    if test.kind == "impulses":
        return ms.ImpulseResponse(values=test.values, sampling_rate=rate)
    if test.kind == "setups":
        parts = zip(test.setups, test.labels, strict=True)
        return ms.Setups(parts=[ms.Signals(outputs=y, sampling_rate=rate, output_dofs=own) for y, own in parts])
    return ms.Signals(outputs=test.outputs, inputs=test.inputs, sampling_rate=rate, output_dofs=test.labels[0])


def columns_of(modes):
    """Return what a list of modes says."""
    if not len(modes):
        return {"frequencies": [], "damping_ratios": []}
    ends = modes.interval(0.95)
    return {
        "frequencies": modes.frequencies,
        "damping_ratios": modes.damping_ratios,
        "shapes": modes.shapes,
        "frequency_interval": ends["frequency"],
        "damping_interval": ends["damping_ratio"],
        "marked": np.array([mode.grade != "good" for mode in modes], bool),
        "labels": list(modes.output_dofs),
    }


def run(test, variant):
    """Analyze, or stabilize and select by one row."""
    from child import CannotError

    import modalscope as ms

    options = {} if test.band is None else {"band": test.band}
    if variant != "modalscope":
        method = variant.removeprefix("row ")
        if test.kind not in ROWS.get(method, ("responses", "impulses", "records", "ambient")):
            raise CannotError(f"{method} is not made for {test.kind}")
        return columns_of(ms.select(ms.stabilize(data_of(test), method=method, **options)))
    if test.kind == "months":
        rows = {name: getattr(test, name) for name in ("record", "frequencies", "damping_ratios", "shapes")}
        tracks = ms.monitoring.track(ms.monitoring.History(times=test.seconds, output_dofs=test.labels[0], **rows))
        f, zeta = (np.nanmedian(values, axis=0) for values in (tracks.frequencies, tracks.damping_ratios))
        return {"frequencies": f, "damping_ratios": zeta}
    return columns_of(ms.analyze(data_of(test), **options).modes)
