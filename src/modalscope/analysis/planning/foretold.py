"""Foretell how well channels will determine poles, from modes that are known and the noise of each channel.

H_oi = sum_k R_oik g_k + terms of the channel, g_k = 1 / (j w - s_k). Residues and terms belong to one channel each, and the poles to all:
with the former eliminated (S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, chapter 3) the information of
channels about the poles is a sum,

    I = sum_oi J_oi' (1 - P_oi) J_oi / s_oi^2,    J_oi: slopes of the channel by the poles, P_oi: projector on functions and terms,

so that channels are chosen by sums of small matrices (C. Papadimitriou, J. Sound Vib. 278, 2004). That residues of several forces are of
rank one tells nothing more of a mode by itself, as what P takes of R_oik g_k' has the direction R_oik itself; of modes that overlap it
tells more, so that deviations are then a little smaller than foretold.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.orthonormal import scaled_span
from modalscope.selection.likelihood.covariance import deviations_of_poles, pole_blocks

#: Information relative to the largest that is rounding.
_ROUNDING = 1e-12


def slopes_left(response: Response, poles: Array) -> RealArray:
    """Return the products of the slopes dg / ds of poles, less what their functions and the terms of a channel explain, (2 n, 2 n).

    `response`: on the lines or samples that are measured. `poles` (n,): rad/s.
    """
    light = response.select(outputs=[0], inputs=[0])
    both = light.functions(poles - response.added_damping, slopes=True)
    functions, slopes = np.split(both, 2, axis=1)
    taken = scaled_span(np.hstack([light.basis(np.zeros(0, complex), light.outside_powers).columns, functions]))
    left = slopes - taken @ (taken.T @ slopes)
    return np.asarray(left.T @ left)


def information(products: RealArray, residues: Array) -> RealArray:
    """Return what channels with noise of deviation one tell of (Re s_1, Im s_1, Re s_2, ...), (..., 2 n, 2 n).

    `products`: of `slopes_left`. `residues` (..., n).
    """
    n = residues.shape[-1]
    # R times a change of s: real and imaginary part of the one by those of the other
    turned = np.stack([np.stack([residues.real, -residues.imag], -1), np.stack([residues.imag, residues.real], -1)], -2)
    blocks = products.reshape(n, 2, n, 2)
    found = np.einsum("...jab,jakc,...kcd->...jbkd", turned, blocks, turned, optimize=True)
    return np.asarray(found.reshape(*residues.shape[:-1], 2 * n, 2 * n))


def deviations_foretold(information: RealArray, poles: Array) -> tuple[RealArray, RealArray]:
    """Return the standard deviations of frequencies (Hz) and damping ratios; infinite for poles that nothing tells of.

    `information` (2 n, 2 n): the sum over channels. `poles` (n,): rad/s.
    """
    size = np.sqrt(np.maximum(np.diag(information), 0))
    told = np.repeat((size.reshape(-1, 2) > _ROUNDING * size.max(initial=0)).all(axis=1), 2)
    f, zeta = np.full((2, len(poles)), np.inf)
    if told.any():
        scale = np.outer(size[told], size[told])
        unit = information[np.ix_(told, told)] / scale + _ROUNDING * np.eye(int(told.sum()))
        blocks = pole_blocks(sla.inv(unit) / scale, np.arange(0, len(unit), 2))
        f[told[::2]], zeta[told[::2]] = deviations_of_poles(poles[told[::2]], blocks)
    return f, zeta
