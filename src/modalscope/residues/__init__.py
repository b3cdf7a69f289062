"""Residues by least squares: B and D of a model, shapes and residuals of modes."""

from modalscope.residues.basis import (
    ModalBasis,
    basis_of_lines,
    basis_of_samples,
    basis_of_window,
    check_residuals,
    fit_error,
    fit_participation,
    fit_shapes,
    rebuilt_rows,
    residual_powers,
    scaled_terms,
)
from modalscope.residues.shapes import fit_residues

__all__ = [
    "ModalBasis",
    "basis_of_lines",
    "basis_of_samples",
    "basis_of_window",
    "check_residuals",
    "fit_error",
    "fit_participation",
    "fit_residues",
    "fit_shapes",
    "rebuilt_rows",
    "residual_powers",
    "scaled_terms",
]
