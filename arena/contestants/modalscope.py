"""modalscope, hands off: the whole job, nothing set but the band that everybody is given."""

import numpy as np

REQUIRES = ()
TAKES = ("responses", "impulses", "records", "ambient", "decay", "earthquake", "setups", "months")
SOURCE = "README: ms.analyze(data)"
VARIANTS = {"modalscope": "the whole job, hands off"}


def data_of(test):
    """Return the test as a data class of modalscope."""
    import modalscope as ms

    if test.kind == "responses":
        lines = test.frequencies > 0
        return ms.FrequencyResponse(
            values=test.values[lines], frequencies=test.frequencies[lines], quantity=test.quantity
        )
    if test.kind == "impulses":
        return ms.ImpulseResponse(values=test.values, sampling_rate=test.sampling_rate)
    if test.kind == "setups":
        parts = zip(test.setups, test.labels, strict=True)
        return ms.Setups(
            parts=[ms.Signals(outputs=y, sampling_rate=test.sampling_rate, output_dofs=own) for y, own in parts]
        )
    return ms.Signals(
        outputs=test.outputs, inputs=test.inputs, sampling_rate=test.sampling_rate, output_dofs=test.labels[0]
    )


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
    """Analyze."""
    import modalscope as ms

    if test.kind == "months":
        rows = {name: getattr(test, name) for name in ("record", "frequencies", "damping_ratios", "shapes")}
        tracks = ms.monitoring.track(ms.monitoring.History(times=test.seconds, output_dofs=test.labels[0], **rows))
        f, zeta = (np.nanmedian(values, axis=0) for values in (tracks.frequencies, tracks.damping_ratios))
        return {"frequencies": f, "damping_ratios": zeta}
    return columns_of(ms.analyze(data_of(test), **({} if test.band is None else {"band": test.band})).modes)
