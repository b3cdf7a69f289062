"""MATLAB files: structures, foreign classes, and axes that MATLAB drops."""

import numpy as np

import modalscope.io as mio
from tests.io import samples
from tests.support import refused


def test_matlab_structures_are_dotted_and_foreign_classes_named(tmp_path):
    import scipy.io as sio
    import scipy.sparse as sparse

    path, frf = tmp_path / "a.mat", samples.frequency_response()
    for compressed in (False, True):
        test = {"H": frf.values, "f": frf.frequencies, "dofs": np.array(frf.output_dofs, dtype=object)}
        sio.savemat(path, {"test": test, "stiffness": sparse.eye_array(3)}, do_compression=compressed)
        rename = {"test.H": "values", "test.f": "frequencies", "test.dofs": "output_dofs"}
        refused("class sparse", mio.read, path, rename=rename)
        back = mio.read(path, rename=rename, ignore=["stiffness"])
        np.testing.assert_array_equal(back.values, frf.values)
        assert back.output_dofs == frf.output_dofs


def test_matlab_drops_trailing_axes_and_they_come_back(tmp_path):
    import scipy.io as sio

    sio.savemat(
        tmp_path / "a.mat",
        {"frequencies": np.arange(1.0, 5), "values": np.arange(8.0).reshape(4, 2) * (1 - 1j)},
        oned_as="row",
    )
    assert mio.read(tmp_path / "a.mat").values.shape == (4, 2, 1)
