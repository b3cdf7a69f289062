"""Ambient setups: what belongs together, and what is refused."""

import numpy as np
import pytest

from modalscope.data import DataError, Records, Setups, Signals
from modalscope.data.setups import as_test


def record(dofs, **options):
    y = np.random.default_rng(len(dofs)).standard_normal((40, len(dofs)))
    return Signals(outputs=y, sampling_rate=options.pop("rate", 10.0), output_dofs=dofs, **options)


def test_a_list_of_records_is_setups_where_outputs_differ_and_nothing_was_driven():
    same, other = record(["1Z", "2Z"]), record(["1Z", "3Z"])
    assert isinstance(as_test([same, same]), Records)
    found = as_test([same, other])
    assert isinstance(found, Setups)
    assert (found.references, found.output_dofs, found.samples) == (("1:+Z",), ("1:+Z", "2:+Z", "3:+Z"), (40, 40))
    assert as_test(found) is found


def test_channels_are_chosen_from_all_setups():
    setups = Setups(parts=[record(["1Z", "2Z", "3Z"]), record(["1Z", "2Z", "4Z"])], groups=["dry", "wet"])
    assert setups.select(exclude=["1Z", "4Z"]).output_dofs == ("2:+Z", "3:+Z")
    assert setups.select(exclude=["1Z"]).references == ("2:+Z",)
    with pytest.raises(DataError, match="no reference remains of"):
        setups.select(outputs=["3Z"])


@pytest.mark.parametrize(
    ("parts", "options", "text"),
    [
        ([], {}, "the list is empty"),
        ([record(["a", "b"]), record(["c", "d"])], {}, "they have none in common"),
        ([record(["a"]), record(["a", "b"], rate=5.0)], {}, "setup 2 5 Hz"),
        ([record(["a"]), record(["a", "b"], inputs=np.ones((40, 1)))], {}, "setup 2 has inputs"),
        ([record(["a"], units="g"), record(["a", "b"])], {}, "a has acceleration in g in one and neither in setup 2"),
        ([record(["a"]), record(["a", "b"])], {"references": ["b"]}, "reference that every setup has, 'b'"),
        ([record(["a"]), record(["a", "b"])], {"groups": ["x"]}, "groups needs 2 labels, one per setup"),
    ],
)
def test_what_are_no_setups_is_said(parts, options, text):
    with pytest.raises(DataError, match=text):
        Setups(parts=parts, **options)
