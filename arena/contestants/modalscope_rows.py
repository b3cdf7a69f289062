"""One row of modalscope's table at a time: a diagram by that method alone, and the choice of modes from it, without refinement."""

from pathlib import Path

REQUIRES = ()
TAKES = ("responses", "impulses", "records", "ambient")
SOURCE = "docs/methods: ms.stabilize(data, method=...), ms.select"
VARIANTS = {
    "row era": "balanced projection",
    "row polyreference": "null space, companion form",
    "row lscf": "matrix fraction of responses",
    "row ssi-data": "projected ambient records",
}


def run(test, variant):
    """Stabilize and select by one row."""
    from child import CannotError, loaded

    import modalscope as ms

    whole = loaded(str(Path(__file__).with_name("modalscope.py")))
    method = variant.removeprefix("row ")
    if (method == "lscf" and test.kind != "responses") or (method == "ssi-data" and test.kind != "ambient"):
        raise CannotError(f"{method} is not made for {test.kind}")
    options = {} if test.band is None else {"band": test.band}
    diagram = ms.stabilize(whole.data_of(test), method=method, **options)
    return whole.columns_of(ms.select(diagram))
