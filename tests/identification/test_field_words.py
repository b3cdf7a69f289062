"""Names and abbreviations that practitioners use: each is a row of the table, or answered by what does its work here."""

from __future__ import annotations

import re

import pytest

import modalscope as ms
from modalscope.data import DataError
from modalscope.identification.method_names import POINTERS, find_method

#: Name in the field, and the row that it is.
ROWS = {
    "ERA": "era", "Ho-Kalman": "era", "NExT-ERA": "era", "Eigensystem Realization Algorithm": "era",
    "SSI-COV": "alternate", "cov_ssi": "alternate", "Kung": "alternate", "ESPRIT": "alternate",
    "LS-ESPRIT": "alternate", "SSI-DATA": "ssi-data", "SSI-UPC": "ssi-data", "UPC": "ssi-data", "SSI-CVA": "ssi-cva",
    "CVA": "ssi-cva", "N4SID": "n4sid", "MOESP": "n4sid", "PO-MOESP": "n4sid", "ITD": "least_squares",
    "Ibrahim": "least_squares", "DMD": "least_squares", "LSCE": "prce", "PRCE": "prce", "PTD": "prce",
    "Prony": "prce", "LSCF": "lscf", "pLSCF": "lscf", "p-LSCF": "lscf", "PolyMAX": "lscf", "DPI": "polyreference",
    "polyreference": "polyreference",
}  # fmt: skip

#: Name in the field, and a word of the answer.
ANSWERED = {
    "ERA/DC": "column_compression", "NExT": "estimate_correlation", "OKID": "estimate_markov",
    "OKID-ERA": "estimate_markov", "SSI": "ssi-cov", "SSI-PC": "ssi-cva", "Polymax Plus": "refine",
    "FDPI": "polyreference", "RFP": "polyreference", "RFP-z": "lscf", "LSFD": "fit_residues", "FDD": "decomposition",
    "EFDD": "decomposition", "FSDD": "decomposition", "peak-picking": "decomposition", "CMIF": "indicator",
    "MMIF": "indicator", "MLE": "refine", "MLMM": "refine", "matrix pencil": "esprit", "circle fit": "band",
    "half-power": "band", "subspace": "n4sid", "ARX": "n4sid", "STD": "itd", "normal mode": "tuned_dwell",
    "phase resonance": "tuned_dwell", "OMA": "ssi-cov", "EMA": "identify", "OMAX": "n4sid",
    "BAYOMA": "posterior under a flat prior", "Bayesian FFT": "refine", "SSI-dat": "ssi-data", "LSRF": "polyreference",
    "AR": "ssi-cov", "Ewins-Gleeson": "band",
}  # fmt: skip


@pytest.mark.parametrize(("name", "row"), ROWS.items())
def test_a_name_of_the_field_is_a_row(name: str, row: str) -> None:
    assert find_method(name, None, "time").name == row


@pytest.mark.parametrize(("name", "word"), ANSWERED.items())
def test_a_name_that_is_no_row_is_answered_by_what_does_its_work(name: str, word: str) -> None:
    with pytest.raises(DataError, match="no row of the table") as told:
        find_method(name, None, "time")
    assert word in str(told.value)


def test_fifty_names_are_known() -> None:
    assert len(ROWS) + len(ANSWERED) >= 50


def test_what_an_answer_names_is_there() -> None:
    for answer in POINTERS.values():
        for path in re.findall(r"modalscope((?:\.\w+)+)\(", answer):
            found: object = ms
            for name in path.strip(".").split("."):
                found = getattr(found, name)
        for row in re.findall(r"method='([\w-]+)'", answer):
            assert find_method(row, None, "time")
