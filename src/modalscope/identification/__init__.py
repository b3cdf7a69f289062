"""The table of methods: data in, identification out. Here stands what runs in place of plain steps of the same name.

The path (see ARCHITECTURE.md) imports data and numerics alone and runs by itself; `modalscope.numerics.handed.plain_steps` shows it.
"""

_HERE = "modalscope.identification"

#: Steps that give what the plain ones give, faster, which their tests show.
FASTER = {
    "cheaper_windows": f"{_HERE}.fast.structured_hankel:cheaper_windows",
    "factorize": f"{_HERE}.fast.factorizations:factorize",
    "fewer_outputs": f"{_HERE}.fast.combinations:fewer_outputs",
    "first_models": f"{_HERE}.fast.together:first_models",
    "left_factor": f"{_HERE}.fast.factorizations:left_factor",
}

#: Steps that take more data, names and options than the plain ones, and say more of what they find.
FURTHER = {
    "built": f"{_HERE}.whitened:built",
    "check_suits": f"{_HERE}.suits:check_suits",
    "deferred_deviations": f"{_HERE}.deviating:deferred_deviations",
    "deviating": "modalscope.selection.likelihood.deviations:OfPipeline",
    "find_method": f"{_HERE}.method_names:find_method",
    "hankel": f"{_HERE}.matrices.general_hankel:hankel",
    "indicators_of_all": f"{_HERE}.modal.accuracy:indicators_of_all",
    "label_of": f"{_HERE}.method_names:label_of",
    "line_weights": f"{_HERE}.matrices.line_columns:line_weights",
    "measure": f"{_HERE}.measure:measure",
    "of_records": f"{_HERE}.of_records:of_records",
    "peaks_of_spectra": "modalscope.signals.preprocess.spectral_peaks:peaks_of_spectra",
    "reduced": f"{_HERE}.realizations.reductions:reduced",
    "rows_with": f"{_HERE}.method_names:rows_with",
    "transfer": f"{_HERE}.matrices.transfer:transfer",
    "transfer_of_response": f"{_HERE}.matrices_beyond:transfer_of_response",
    "turned_hankel": f"{_HERE}.matrices.general_hankel:turned_hankel",
    "whitening_of_row": f"{_HERE}.whitened:whitening_of_row",
}
