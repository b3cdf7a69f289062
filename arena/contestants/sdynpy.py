"""SDynPy: PolyPy (several references) with the poles that a person picks from the stability chart, and SMAC, whose roots fit themselves."""

import os

import numpy as np

REQUIRES = ("sdynpy==0.23.0",)
TAKES = ("responses",)
SOURCE = (
    "SDynPy, tutorial Complex Modes: PolyPy(frfs), compute_poles(np.arange(5, 30, 2)), stable poles by hand; "
    "SMAC: the defaults of its methods in turn"
)
VARIANTS = {
    "SDynPy PolyPy": "polyreference LSCF, stable poles nearest to given frequencies",
    "SDynPy SMAC": "synthesize modes and correlate, automatic fit",
}
DERIVATIVES = {"displacement": 0, "velocity": 1, "acceleration": 2}


def run(test, variant):
    """Fit."""
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    import sdynpy as sdpy

    f = test.frequencies
    kept = f > 0
    coordinates = [sdpy.coordinate_array(np.arange(1, n + 1), "X+") for n in test.values.shape[1:]]
    frfs = sdpy.data_array(
        sdpy.data.FunctionTypes.FREQUENCY_RESPONSE_FUNCTION,
        abscissa=f[kept],
        ordinate=np.ascontiguousarray(test.values[kept].transpose(1, 2, 0)),
        coordinate=sdpy.coordinate.outer_product(*coordinates),
    )
    low, high = test.band or (None, None)
    derivative = DERIVATIVES.get(test.quantity, 2)
    if variant == "SDynPy SMAC":
        smac = sdpy.SMAC(frfs, low, high, displacement_derivative=derivative)
        smac.compute_pseudoinverse()
        smac.compute_initial_rootlist()
        smac.autofit_roots()
        smac.compute_residues(smac.rootlist)
        shapes = smac.residues[:, 0]  # of the first reference
        return {"frequencies": smac.rootlist["frequency"], "damping_ratios": smac.rootlist["damping"], "shapes": shapes}
    fit = sdpy.PolyPy(frfs, low, high, displacement_derivative=derivative)
    fit.compute_poles(np.arange(5, 30, 2))
    poles = fit.pole_list_from_indices(_picked(fit, test.human("frequencies")))
    fit.compute_shapes(poles)
    shapes = fit.shapes.shape_matrix.T[: test.values.shape[1]]
    return {"frequencies": poles["omega"] / 2 / np.pi, "damping_ratios": poles["zeta"], "shapes": shapes}


def _picked(fit, frequencies):
    """Return the poles that a person would click: of the highest order at which the nearest ones are as stable as at any."""
    picked = []
    for frequency in sorted(set(frequencies)):
        choices = []
        for i, poles in enumerate(fit.pole_list):  # the highest order first
            away = abs(poles["omega"] / 2 / np.pi / frequency - 1)
            near = [int(j) for j in np.argsort(away)[: frequencies.count(frequency)] if away[j] < 0.01]
            stable = sum(poles[name][near].sum() for name in ("freq_stable", "damp_stable", "part_stable"))
            choices.append((len(near), stable, -i, near))
        best = max(choices)
        picked += [(-best[2], j) for j in best[3]]
    return picked
