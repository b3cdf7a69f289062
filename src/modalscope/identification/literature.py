"""Names of the rows of the report in the literature: the most common one, others with the options that give them, and what is accepted."""

from __future__ import annotations

from typing import NamedTuple

#: Columns of the table.
DOMAINS = {
    "time": "Hankel matrix of Markov parameters",
    "z": "shifted transfer functions",
    "s": "differentiated transfer functions",
}


class Names(NamedTuple):
    """Names of one cell: the common one, those of the literature, and what is accepted besides."""

    common: str
    known_as: tuple[str, ...]
    aliases: tuple[str, ...] = ()


#: By row and domain.
NAMES: dict[tuple[str, str], Names] = {
    ("era", "time"): Names(
        "ERA",
        ("ERA", "Ho-Kalman", "ERA/DC with column_compression=H(0)", "NExT-ERA on correlations"),
        ("ho-kalman", "next-era", "eigensystem realization algorithm", "projected-dmd"),
    ),
    ("era", "z"): Names("ERA-FD", ("ERA-FD",), ("era-fd",)),
    ("era", "s"): Names("ERA-FD", ("ERA-FD, continuous",), ("era-fd continuous",)),
    ("polyreference", "time"): Names(
        "Polyreference", ("polyreference, canonical-form realization",), ("canonical-form realization",)
    ),
    ("polyreference", "z"): Names("Polyreference FD", ("polyreference FD",), ("polyreference-fd",)),
    ("polyreference", "s"): Names(
        "Polyreference FD",
        ("polyreference FD, continuous", "direct parameter identification"),
        ("dpi", "direct parameter identification"),
    ),
    ("alternate", "time"): Names(
        "SSI-cov",
        ("SSI-cov on correlations", "Kung", "LS-ESPRIT", "ERA without H(1)", "optimized DMD when refined"),
        (
            *("ssi-cov", "cov-ssi", "kung", "ls-esprit", "esprit"),
            *("tls-dmd", "total-least-squares dmd", "optimized-dmd"),
        ),
    ),
    ("alternate", "z"): Names("FD-subspace", ("alternate FD",), ("alternate-fd",)),
    ("alternate", "s"): Names(
        "FD-subspace",
        ("alternate FD, continuous", "frequency-domain subspace identification"),
        ("fd-subspace", "frequency-domain subspace identification"),
    ),
    ("least_squares", "time"): Names(
        "ITD",
        ("least squares regression, truncated", "ITD (Ibrahim), truncated", "delay-embedded DMD"),
        ("itd", "ibrahim", "ibrahim time domain", "dmd", "exact-dmd", "delay-embedded dmd", "hankel-dmd"),
    ),
    ("least_squares", "z"): Names("Least squares", ("least squares FD",), ("least-squares-fd",)),
    ("least_squares", "s"): Names("Least squares", ("least squares FD, continuous", "first-order form, Eq. 109")),
    ("prce", "time"): Names(
        "PRCE",
        (
            "PRCE, polyreference complex exponential",
            "LSCE with one input",
            "Prony with one channel",
            "ITD (Ibrahim) with one input, form='observable'",
        ),
        ("lsce", "prony", "polyreference complex exponential", "ptd"),
    ),
}
