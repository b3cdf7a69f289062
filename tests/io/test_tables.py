"""Measured records under their own names."""

import modalscope.io as mio
from tests.support import measured


def test_measured_records_are_read_under_their_own_names():
    records, hits = measured("palisaden", "palisaden_dec5.npz"), measured("impact_hits", "impacts.npz")
    names = ("ch1", "ch2", "ch3", "ch4", "ch5", "ch6")
    house = mio.read(
        records, rename={"y": "outputs", "fs": "sampling_rate"}, quantity="acceleration", output_dofs=names
    )
    assert (house.outputs.shape, house.sampling_rate) == ((108000, 6), 20.0)
    hammer = mio.read(
        hits,
        rename={"acc": "outputs", "force": "inputs", "fs": "sampling_rate"},
        axes={"outputs": "runs samples", "inputs": "runs samples"},
    )
    assert (hammer.outputs.shape, hammer.inputs.shape) == ((5, 51200, 1), (5, 51200, 1))
