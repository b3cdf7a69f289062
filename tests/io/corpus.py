"""Small whole files of every format, written here and as other programs write them: what mutations start from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

import modalscope as ms
import modalscope.io as mio
from modalscope.data.analysis import Analysis, SourceFile
from modalscope.io.analysis import write_analysis
from tests.extras.test_seismic import record, sac
from tests.io import samples

h5py = pytest.importorskip("h5py")


def write(folder: Path) -> list[Path]:
    """Write the corpus and return its files."""
    things = {name.replace(" ", "-"): make() for name, make in samples.EVERY.items()}
    for name, thing in things.items():
        for suffix in (".npz", ".mat", ".h5", ".uff"):
            mio.write(folder / f"{name}{suffix}", thing)
    for name in ("frequency-response", "impulse-response", "records"):
        mio.write(folder / f"{name}-text.uff", things[name], text=True)
    mio.write(folder / "modes-2414.uff", things["modes"], dataset=2414)
    mio.write(folder / "geometry-15.uff", things["geometry"], nodes=15, lines=2412)
    for name in ("frequency-response", "records"):
        mio.write(folder / f"{name}.csv", things[name])
    mio.write(folder / "modes.json", things["modes"], method="era", domain="time", orders=range(2, 9, 2))
    model = ms.systems.spring_chain(2).state_space(dt=0.1)
    for suffix in (".npz", ".mat", ".h5", ".json"):
        mio.write(folder / f"state-space{suffix}", model)
    diagram = ms.stabilize(ms.systems.chain5().impulse_response(30, noise=0.01, seed=0), orders=range(2, 7, 2))
    for suffix in (".npz", ".json"):
        mio.write(folder / f"diagram{suffix}", diagram)
    document = Analysis(files=(SourceFile(path="a.uff", size=3, sha256="00"),), options={"a": np.arange(3.0)})
    write_analysis(folder / "a.analysis.json", document)
    _foreign(folder)
    values = np.cumsum(np.arange(200) % 7 - 3)
    for encoding in (3, 10):
        (folder / f"encoding-{encoding}.mseed").write_bytes(record(values, encoding))
    (folder / "one.sac").write_bytes(sac(values))
    return sorted(folder.iterdir())


def _foreign(folder: Path) -> None:
    """Write files as other programs do: compressed, in earlier versions, without checksums."""
    frf = samples.frequency_response()
    arrays = {"values": frf.values, "frequencies": frf.frequencies}
    np.savez_compressed(folder / "foreign.npz", **arrays)
    labels = np.array(frf.output_dofs, dtype=object)
    scipy.io.savemat(folder / "foreign.mat", arrays | {"output_dofs": labels}, do_compression=True)
    for name, options in (("foreign", {}), ("foreign-new", {"libver": "latest"})):
        with h5py.File(folder / f"{name}.h5", "w", **options) as file:
            file["frequencies"], file["output_dofs"] = frf.frequencies, list(frf.output_dofs)
            for part, values in (("real", frf.values.real), ("imag", frf.values.imag)):
                file.create_dataset(f"values_{part}", data=values, compression="gzip", shuffle=True, chunks=(2, 3, 2))
    with h5py.File(folder / "foreign-73.mat", "w", userblock_size=512) as file:
        pair = np.empty(frf.values.T.shape, dtype=[("real", "f8"), ("imag", "f8")])
        pair["real"], pair["imag"] = frf.values.T.real, frf.values.T.imag
        file.create_dataset("values", data=pair).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("frequencies", data=frf.frequencies[:, None], compression="gzip")
        cells = []
        for k, label in enumerate(frf.output_dofs):
            text = file.create_dataset(f"#refs#/{k}", data=np.array([[ord(c)] for c in label], "u2"))
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cells.append(text.ref)
        cell = file.create_dataset("output_dofs", data=np.array(cells, dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with (folder / "foreign-73.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
