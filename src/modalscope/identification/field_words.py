"""What practitioners call methods that are no row of the table, and where the work that each names is done here."""

from __future__ import annotations

__all__ = ["POINTERS"]

_FDD = (
    "Singular values of spectra and their peaks are modalscope.preprocess.decomposition(record).peaks() (the command psd); "
    "for damping take ssi-cov."
)
_MARKOV = "Estimate Markov parameters first, modalscope.estimate_markov(record), and identify them by era; or leave method out."
_ML = "Found modes are refined to the maximum of the likelihood: modalscope.refine(data, modes), which analyze does by itself."
_FRACTION = "The matrix fraction on orthogonal polynomials is polyreference in s; with few states alternate in s is the better conditioned."
_SINGLE = (
    "Fits of one resonance at a time are not offered: give the band around it, band=(f1, f2), and any row of the table."
)
_RECORDS = "Records with inputs take n4sid, or no method at all (records on their own lines); without inputs ssi-cov or ssi-data."
_RESIDUES = "Residues to known poles are modalscope.fit_residues(response, modes); identify fits them by itself."
_DWELL = "Appropriated forces and their indicator are modalscope.tuned_dwell(response)."
_INDICATOR = (
    "That is an indicator, not a method: modalscope.plot.indicator(response) draws it, select reads it by itself."
)
_AMBIENT = (
    "Ambient records need no special call: identify, stabilize and analyze take them as they are, ssi-cov by default."
)
_FRF = "Frequency responses need no special call: identify, stabilize and analyze take them as they are."

#: Names in plain words, small letters with blanks between, and what to do in place of them.
POINTERS: dict[str, str] = {
    "era dc": "Take method='era' with column_compression=H0, the Hankel matrix itself: it then works on correlations.",
    "next": "Estimate correlations, modalscope.estimate_correlation(record), and take method='era'; the default is ssi-cov.",
    "okid": _MARKOV,
    "okid era": _MARKOV,
    "okid/era": _MARKOV,
    "era/okid": _MARKOV,
    "era/dc": "Take method='era' with column_compression=H0, the Hankel matrix itself: it then works on correlations.",
    "ssi": "Say which: ssi-cov (correlations), ssi-data (records projected on their past) or ssi-cva (the same, canonical variates).",
    "ssi pc": "Principal components with weights are not offered: take ssi-data (unweighted) or ssi-cva (canonical variates).",
    "polymax plus": f"Take polymax, then the likelihood. {_ML}",
    "fdpi": "Take method='polyreference', domain='s': direct parameter identification, also called dpi.",
    "rfp": _FRACTION,
    "grfp": _FRACTION,
    "rfp z": "Take method='lscf': the matrix fraction in z.",
    "lsfd": _RESIDUES,
    "fdd": _FDD,
    "efdd": _FDD,
    "fsdd": _FDD,
    "cfdd": _FDD,
    "peak picking": _FDD,
    "pp": _FDD,
    "bfdd": _FDD,
    "cmif": _INDICATOR,
    "mif": _INDICATOR,
    "mmif": _INDICATOR,
    "mle": _ML,
    "mlmm": _ML,
    "ml": _ML,
    "maximum likelihood": _ML,
    "bayesian fft": f"Not offered. {_ML}",
    "matrix pencil": "Take method='esprit' (the row alternate): the pencil of a Hankel matrix and its shift.",
    "half power": _SINGLE,
    "circle fit": _SINGLE,
    "sdof": _SINGLE,
    "smac": _SINGLE,
    "subspace": "Say which: n4sid (records with inputs), ssi-data (without), fd-subspace (frequency responses).",
    "arx": _RECORDS,
    "armax": _RECORDS,
    "arma": _RECORDS,
    "pem": _RECORDS,
    "std": "Sparse time domain is a way to compute Ibrahim's method: take method='itd'.",
    "mritd": "Take method='itd' with several decays as inputs.",
    "normal mode": _DWELL,
    "phase resonance": _DWELL,
    "force appropriation": _DWELL,
    "oma": _AMBIENT,
    "ema": _FRF,
    "omax": _RECORDS,
}
