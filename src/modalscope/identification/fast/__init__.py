"""Faster forms of steps of an identification: each gives what the plain step of the same name gives, which its test shows."""

_HERE = "modalscope.identification.fast"

#: Where the steps stand that run in place of the plain ones: `modalscope.numerics.handed` calls them by name.
STEPS = {
    "built": "modalscope.identification.matrices.whitened:built",
    "measure": "modalscope.identification.measure:measure",
    "whitening_of_row": "modalscope.identification.matrices.whitened:whitening_of_row",
    "cheaper_windows": f"{_HERE}.structured_hankel:cheaper_windows",
    "find_method": "modalscope.identification.method_names:find_method",
    "rows_with": "modalscope.identification.method_names:rows_with",
    "factorize": f"{_HERE}.factorizations:factorize",
    "fewer_outputs": f"{_HERE}.combinations:fewer_outputs",
    "hankel": "modalscope.identification.matrices.general_hankel:hankel",
    "indicators_of_all": "modalscope.identification.modal.accuracy:indicators_of_all",
    "check_suits": "modalscope.identification.suits:check_suits",
    "deferred_deviations": "modalscope.identification.deviating:deferred_deviations",
    "peaks_of_spectra": "modalscope.signals.preprocess.spectral_peaks:peaks_of_spectra",
    "deviating": "modalscope.selection.likelihood.deviations:OfPipeline",
    "first_models": f"{_HERE}.together:first_models",
    "left_factor": f"{_HERE}.factorizations:left_factor",
    "line_weights": "modalscope.identification.matrices.line_columns:line_weights",
    "transfer": "modalscope.identification.matrices.transfer:transfer",
    "transfer_of_response": "modalscope.identification.matrices.of_method:transfer_of_response",
    "turned_hankel": "modalscope.identification.matrices.general_hankel:turned_hankel",
}
