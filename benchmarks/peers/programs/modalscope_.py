"""This library. Whole jobs: with modes, shapes and indicators, where the others give A, B, C or poles."""

import numpy as np

import modalscope as ms
from modalscope.identification.matrices.fraction import fraction
from modalscope.identification.realizations.fraction_companion import fraction_companion


def _response(data):
    return ms.ImpulseResponse(values=data["values"], sampling_rate=1.0)


def era(data):
    """A of one order by ERA: r x s blocks of the samples 0 to r + s - 1."""
    return _identified(data, "era", int(data["rows"]))


def alternate(data):
    """A of one order by the shift of the left factor, which has r + 1 block rows on the samples that pyMOR reads."""
    return _identified(data, "alternate", int(data["rows"]) - 1)


def _identified(data, method, rows):
    found = ms.identify(
        _response(data),
        method=method,
        order=int(data["order"]),
        block_rows=rows,
        block_columns=int(data["columns"]),
        deviations=False,
    )
    return found.state_space.A


def markov(data, **options):
    """A by OKID and ERA; nineteen orders of the observer are tried."""
    record = ms.Signals(outputs=data["outputs"], inputs=data["inputs"], sampling_rate=1.0)
    response = ms.estimate_markov(record, samples=int(data["samples"]), **options)
    return ms.identify(response, method="era", order=int(data["order"]), deviations=False).state_space.A


def markov_of_order(data):
    """The same with an observer of a given order, its rank by cross-validation."""
    return markov(data, observer_order=30)


def ssi_cov(data):
    """All orders of SSI-cov; the poles of one of them."""
    return _ambient(data, method="alternate", domain="time", lags=2 * int(data["rows"]) - 1)


def ssi_data(data):
    """All orders of SSI-data; the poles of one of them."""
    return _ambient(data, method="ssi-data", block_columns=int(data["rows"]))


def _ambient(data, lags=None, **options):
    record = ms.Signals(outputs=data["outputs"], sampling_rate=1.0)
    if lags is not None:
        record = ms.estimate_correlation(record, lags=lags)
        options["block_columns"] = int(data["rows"])
    diagram = ms.stabilize(
        record, orders=range(1, int(data["largest"]) + 1), block_rows=int(data["rows"]) - 1, deviations=False, **options
    )
    return np.exp(diagram.poles[diagram.order_of_pole == int(data["order"])])


def lscf(data):
    """Poles of every degree; those of the highest."""
    response = ms.FrequencyResponse(values=data["values"], frequencies=data["frequencies"])
    matrix = fraction(response, degree=int(data["degree"]))
    model = fraction_companion(matrix, matrix.factors)
    for degree in range(1, int(data["degree"]) + 1):
        poles = matrix.to_s(1 / np.linalg.eigvals(model.triple(degree).A))
    return poles


def lscf_diagram(data):
    """The whole diagram with shapes; the poles of the highest degree."""
    response = ms.FrequencyResponse(values=data["values"], frequencies=data["frequencies"])
    diagram = ms.stabilize(response, method="lscf", orders=range(1, int(data["degree"]) + 1), deviations=False)
    return diagram.poles


def era_whole(data):
    """ERA with sizes of its own choice."""
    return ms.identify(_response(data), method="era", order=int(data["order"]), deviations=False).state_space.A


def every_order(data):
    """A diagram of frequency responses up to an order."""
    response = ms.FrequencyResponse(values=data["values"], frequencies=data["frequencies"], quantity="displacement")
    return ms.stabilize(response, orders=range(2, int(data["order"]) + 1, 2), deviations=False).poles


def correlations(data):
    """Correlations of a record with itself."""
    record = ms.Signals(outputs=data["outputs"], sampling_rate=1.0)
    return ms.estimate_correlation(record, lags=int(data["lags"])).values[0, 0]
