"""Real tests: every measured set beside the project, analysed as a user would, and the list of modes that comes out.

A commit that loses a mode of a real test, or adds one, differs from the reference, and so does one that changes a shape, a deviation or a
grade. What is held is the list (frequencies in Hz, damping ratios), their standard deviations and those of the shapes, the shapes, the
grades, the share of the measured mean square that is explained, and in how many bands the modes were found. A file that is refused is held
as refused.

Other processors sum in another order, and where a candidate is on the brink, rounding decides. `OPENBLAS_CORETYPE=Haswell` and `Prescott`
gave every list below as SkylakeX does, to 1e-11 of frequencies and 1e-10 of damping, the beam with two neighbours at 4.2 kHz to 1e-6 and
1.3e-3. Three files are taken in a band for this reason: in all of their lines the lists differ from kernel to kernel. Of the ruler's
arrays, whose peaks are split in one list and whole in the next, only the eight peaks are held.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import modalscope as ms
from modalscope.interfaces.plot.web.fits import fit_of_bands
from modalscope.numerics.checks import RealArray
from tools.jobs import JOBS, Missing, Told, face, job, measured, numbers
from tools.results import SHAPES

__all__ = ["FILES", "JOBS", "Missing", "listed"]

#: Files that are opened as they are, with what the table of the measured data says beside them, or nothing.
FILES: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "beam_hammer": (("beam_hammer/beam_mimo_frf.npz",), {"band": (1200.0, 4500.0)}),
    "hati_gvt": (("hati_gvt/hati_ws3_frf.npz",), {}),
    "palisaden": (("palisaden/palisaden_dec5.npz",), {}),
    "beam_uff": (("beam_uff/beam_2kHz.uff",), {"band": (30.0, 800.0)}),
    "shear_frame": (("shear_frame/data_shearframe.npy",), {"reading": {"sampling_rate": 12.0}}),
    "footbridge, hammer without its force": (("footbridge/impulse_VI0.txt",), {}),
    "footbridge, wind": (("footbridge/ambient_testVI.lvm",), {}),
    "footbridge, wireless node": (("footbridge/node_p1_000.CSV",), {"band": (5.0, 40.0)}),
    "turbine_tdms": (("turbine_tdms/good_tdms_1.tdms",), {}),
    "meloland": (tuple(f"meloland/CHAN{k:02d}.V2" for k in range(1, 27)), {}),
    "kyowa_frame, set 1 as it is": (("kyowa_frame/imp_ham_set1_nomass.CSV",), {}),
    "kyowa_frame, set 2 as it is": (("kyowa_frame/imp_ham_set2_nomass.CSV",), {}),
    "kyowa_frame, set 1": (("kyowa_frame/imp_ham_set1_nomass.CSV",), {"reading": {"columns": "in=CH8"}}),
    "kyowa_frame, set 2": (("kyowa_frame/imp_ham_set2_nomass.CSV",), {"reading": {"columns": "in=CH8"}}),
    "labview_beam": (("labview_beam/acceleration.lvm",), {}),
    "ruler_mat, ten responses": (("ruler_mat/ruler_grid_acc_3.mat",), {"band": (5.0, 300.0)}),
    "ruler_mat, coherence": (("ruler_mat/jw_tf_coh.mat",), {}),
    "ruler_mat, time": (("ruler_mat/jw_time.mat",), {}),
    "board_lvm": (("board_lvm/vibration_1.lvm",), {"band": (20.0, 500.0)}),
    "labview_spectrum": (("labview_spectrum/FFT_data.lvm",), {}),
    "labview_forms, hits": (("labview_forms/long_single_header_multi_ch.lvm",), {"reading": {"columns": "in=1"}}),
    "labview_forms, several times": (("labview_forms/multi_time_column.lvm",), {}),
    "labview_forms, no decimal sign": (("labview_forms/no_decimal_separator.lvm",), {}),
    "labview_forms, short": (("labview_forms/short.lvm",), {}),
    "labview_forms, comments": (("labview_forms/with_comments.lvm",), {}),
    "labview_forms, empty fields": (("labview_forms/with_empty_fields.lvm",), {}),
}


#: Deviations of shapes of unit length below this are rounding: of one output the only component is fixed.
_ROUNDING_OF_SHAPES = 1e-6


def _beyond_rounding(deviations: RealArray) -> RealArray:
    """Return the deviation of every shape (l, n) as a whole, (n,); zero where it is rounding."""
    whole = np.linalg.norm(deviations, axis=0)
    return np.asarray(np.where(whole < _ROUNDING_OF_SHAPES, 0.0, whole))


def listed(thing: Any, **options: Any) -> Told:
    """Return the list of modes of a whole analysis, or that it was refused."""
    try:
        found = face.analyze(thing, **options)
    except ms.DataError as error:
        if "is not installed" in error.found:
            raise Missing(error.found) from None
        return {"refused": [bool(error.asked), bool(error.found), bool(error.change)]}
    modes = found.modes
    fit = fit_of_bands(modes, found.diagrams) if len(modes) else None
    ends = [modes.frequencies_std, modes.damping_ratios_std] if len(modes) else [None, None]
    return {
        "bands": len(found.diagrams),
        "f": numbers(modes.frequencies),
        "zeta": numbers(modes.damping_ratios),
        "f_std": numbers(ends[0]),
        "zeta_std": numbers(ends[1]),
        "shapes_std": None if modes.shapes_std is None else numbers(_beyond_rounding(modes.shapes_std)),
        "grades": [mode.grade for mode in modes],
        SHAPES: [[float(f"{x:.5g}") for z in shape for x in (z.real, z.imag)] for shape in modes.shapes.T],
        "explained": None if fit is None else 1 - float(fit[0]) ** 2,
    }


def _of_files(names: tuple[str, ...], options: Mapping[str, Any]) -> Callable[[], Told]:
    def run() -> Told:
        paths = [measured(*name.split("/")) for name in names]
        return listed(paths[0] if len(paths) == 1 else paths, **options)

    return run


for _name, (_names, _options) in FILES.items():
    job(f"real: {_name}")(_of_files(_names, _options))


#: Hz, as the authors of the measurement printed them; they scatter by .5 Hz over single responses.
_PUBLISHED = (177.0, 477.4, 933.1, 1535.5, 2286.9, 3162.4, 4181.2)


@job("real: beam_hammer, published modes")
def _() -> Told:
    told = listed(measured("beam_hammer", "beam_mimo_frf.npz"), band=(100.0, 4500.0))
    found = np.array(told["f"])
    return {"published": [bool(np.any(np.abs(found - f) < 0.5)) for f in _PUBLISHED]}


@job("real: roving_pair")
def _() -> Told:
    return listed(measured("roving_pair", "roving.uff"))


#: Each file is a structure of its own: the masses differ.
_MASSES = ("P-1", "P-2", "P-3", "P-4", "P-5", "P-6", "P-61", "P-62")


def _of_masses(name: str) -> Callable[[], Told]:
    return lambda: listed(measured("beam_masses", f"{name}.txt"))


for _name in _MASSES:
    job(f"real: beam_masses, {_name}")(_of_masses(_name))


def _of_standin(name: str) -> Callable[[], Told]:
    def run() -> Told:
        folder = measured("standins", name)
        paths = [folder / file for file in json.loads((folder / "truth.json").read_text("utf-8"))["files"]]
        return listed(paths[0] if len(paths) == 1 else paths)

    return run


#: Small files of faults that strangers' files showed; beside them stands what is right.
_STANDINS = (
    *("analyser_mat", "analyser_text", "camera_stack", "dead_force", "dead_tail", "decay_multiples", "drive_voltage"),
    *("headless_lines", "knet_ew", "knet_txt", "late_start", "line_by_line", "lines_missing", "listed_units"),
    *("lvm_slow_channels", "matlab_objects", "names_of_responses", "one_frame_lost", "quoted_rows", "repeated_hits"),
    *("responses_below_each_other", "sine_input", "slow_extras", "start_glitch", "stray_cells_csv"),
    *("tdms_late_channel", "two_counters", "two_poles", "uff58_uneven_double", "units_between_names"),
    *("velocity_decay", "walking", "weak_first_points", "weak_hit", "wrapped_txt_other"),
)

for _name in _STANDINS:
    job(f"real: standins, {_name}")(_of_standin(_name))


def _arrays(*parts: str) -> Mapping[str, Any]:
    with np.load(measured(*parts), allow_pickle=False) as held:
        return {name: held[name] for name in held.files}


@job("real: hati_gvt, records")
def _() -> Told:
    held = _arrays("hati_gvt", "hati_ws3_200Hz.npz")
    runs = [
        face.Signals(
            outputs=acc,
            inputs=force[:, None],
            sampling_rate=float(held["fs"]),
            output_dofs=[f"{2 * k}", f"{2 * k + 1}"],
        )
        for k, (force, acc) in enumerate(zip(held["force"], held["acc"], strict=True))
    ]
    return listed(face.merge(runs))


@job("real: impact_hits")
def _() -> Told:
    held = _arrays("impact_hits", "impacts.npz")  # the first hit is overloaded
    acc, force = held["acc"][1:, :, None], held["force"][1:, :, None]
    return listed(face.Signals(outputs=acc, inputs=force, sampling_rate=float(held["fs"])))


@job("real: building_3sl")
def _() -> Told:
    held = _arrays("building_3sl", "tsl3.npz")  # three setups, whose first three channels are common
    parts = [
        face.Signals(
            outputs=run,
            sampling_rate=float(held["fs"]),
            output_dofs=["a", "b", "c", *(f"{k}.{channel}" for channel in range(run.shape[1] - 3))],
        )
        for k, run in enumerate(held["y"])
    ]
    return listed(face.Setups(parts=parts))


@job("real: bridge_ssicov")
def _() -> Told:
    held = _arrays("bridge_ssicov", "ssicov.npz")
    return listed(face.Signals(outputs=held["y"], sampling_rate=float(held["fs"])))


#: Hz: the lines below 1000 Hz where the sum of squares over the ten channels has a peak that stands out by 10 dB.
_PEAKS_OF_RULER = (6.71, 39.67, 108.64, 211.79, 352.78, 517.58, 551.15, 729.37)


@job("real: ruler_mat, its arrays")
def _() -> Told:
    from scipy.io import loadmat

    held = loadmat(str(measured("ruler_mat", "ruler_grid_acc_3.mat")))
    step = float(held["freq"].item()) / float(held["npts"].item())  # `freq` is the sampling rate
    lines = slice(1, int(1000 / step))
    frequencies = step * np.arange(len(held["yspec"]))
    told = listed(face.FrequencyResponse(values=held["yspec"][lines, :, None], frequencies=frequencies[lines]))
    found = np.array(told["f"])
    return {"peaks": [bool(np.any(np.abs(found - f) < 2 * step)) for f in _PEAKS_OF_RULER]}
