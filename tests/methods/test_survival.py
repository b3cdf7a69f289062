"""Which realization survives which operation on the data matrix, without noise: the poles, or an error that says why not."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import DataError
from modalscope.identification.identify import identify
from modalscope.systems import Structure
from tests.support import FIVE, match_poles, random_projection, relative, row_selection, row_sums

STRUCTURE = FIVE["chain5"]()
RESPONSE = STRUCTURE.impulse_response(120)
TRUTH = np.linalg.eigvals(STRUCTURE.state_space().A)
N, ROWS, COLUMNS = TRUTH.size, 12, 24
OUTPUTS, INPUTS = RESPONSE.values.shape[1:]

RNG = np.random.default_rng(8)
SIDE = {"outputs": OUTPUTS, "inputs": INPUTS, "rows": ROWS * OUTPUTS, "columns": COLUMNS * INPUTS}
UNEVEN_ROWS = [0, 1, 2, 3, 5, 6, 8, 9, 10, 13, 14, 15]
UNEVEN_COLUMNS = [*range(20), 22, 25, 27, 30]

#: What is done to the matrix, and which side's shift it destroys.
OPERATIONS = {
    "weights of outputs": ({"row_weights": RNG.uniform(0.5, 2, OUTPUTS)}, ""),
    "weights of inputs": ({"column_weights": RNG.uniform(0.5, 2, INPUTS)}, ""),
    "weights of rows": ({"row_weights": RNG.uniform(0.5, 2, SIDE["rows"])}, ""),
    "weights of columns": ({"column_weights": RNG.uniform(0.5, 2, SIDE["columns"])}, ""),
    "outputs combined within blocks": ({"row_compression": random_projection(3, OUTPUTS, seed=1)}, ""),
    "outputs selected within blocks": ({"row_compression": row_selection([0, 2, 3], OUTPUTS)}, ""),
    "outputs summed within blocks": ({"row_compression": row_sums([[0, 1], [2]], OUTPUTS)}, ""),
    "inputs combined within blocks": ({"column_compression": random_projection(1, INPUTS, seed=2)}, ""),
    "rows compressed": ({"row_compression": random_projection(N + 4, SIDE["rows"], seed=3)}, "rows"),
    "columns compressed": ({"column_compression": random_projection(N + 4, SIDE["columns"], seed=4)}, "columns"),
    "uneven row shifts": ({"row_shifts": UNEVEN_ROWS}, "rows"),
    "uneven column shifts": ({"column_shifts": UNEVEN_COLUMNS}, "columns"),
    "a sensor in the first block only": ({"row_subsets": [[*range(OUTPUTS)], *[[0, 2]] * (ROWS - 1)]}, "whole rows"),
    "an input in the first block only": (
        {"column_subsets": [[*range(INPUTS)], *[[0]] * (COLUMNS - 1)]},
        "whole columns",
    ),
}

REALIZATIONS = [
    (method, form)
    for method in ("era", "least_squares", "alternate", "polyreference", "prce")
    for form in ("observable", "controllable")
]


def survives(method: str, form: str, destroyed: str) -> bool:
    """The shift is read off rows in the observable form, off columns in the controllable one; companions need whole blocks too."""
    own = "rows" if form == "observable" else "columns"
    if method in ("era", "least_squares"):
        return True
    if method == "alternate":
        return destroyed != own
    return own not in destroyed


@pytest.mark.slow
@pytest.mark.parametrize(("method", "form"), REALIZATIONS)
@pytest.mark.parametrize("operation", OPERATIONS)
def test_what_survives_what(operation, method, form):
    options, destroyed = OPERATIONS[operation]
    options = {"block_rows": ROWS, "block_columns": COLUMNS, **options}
    for side in ("row", "column"):
        if f"{side}_shifts" in options:
            options.pop(f"block_{side}s")
    order = N
    if method == "prce":
        kept = options.get("row_compression" if form == "observable" else "column_compression")
        block = OUTPUTS if form == "observable" else INPUTS
        if kept is not None and kept.shape[1] == block:
            block = kept.shape[0]
        order = block * (ROWS if form == "observable" else COLUMNS)
    if not survives(method, form, destroyed):
        with pytest.raises(DataError, match=r"(has no row shift|not consecutive|not whole)"):
            identify(RESPONSE, method=method, form=form, order=order, **options)
        return
    found = identify(RESPONSE, method=method, form=form, order=order, **options)
    match = match_poles(found.modes.poles, TRUTH)
    # sums and few directions see less of a mode than all sensors did: two digits below the plain matrix
    assert match.frequency_error < 1e-9
    assert match.damping_error < 1e-7
    # B and C are of the uncompressed, unweighted channels: the whole model rebuilds the data
    assert relative(found.rebuild().values, RESPONSE.values) < 1e-7


def test_sums_carry_their_warning_into_the_result():
    options = {"block_rows": ROWS, "block_columns": COLUMNS, "order": N}
    found = identify(RESPONSE, method="era", row_compression=row_sums([[0, 1], [2, 3]], OUTPUTS), **options)
    assert any("antisymmetric" in str(note) for note in found.notes)
    found = identify(RESPONSE, method="era", row_compression=row_selection([0, 1], OUTPUTS), **options)
    assert not any("antisymmetric" in str(note) for note in found.notes)


def test_sums_do_lose_the_antisymmetric_modes():
    """Five equal masses between two walls, all outputs added: the three symmetric modes are left, which is rank 6."""
    K = 400.0 * (2 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1))
    symmetric = Structure(mass=np.eye(5), stiffness=K, damping=2e-4 * K + 0.05 * np.eye(5), dt=0.05)
    response = symmetric.impulse_response(120)
    options = {"method": "era", "block_rows": 20, "block_columns": 40}
    assert identify(response, **options).order == 10
    assert identify(response, row_compression=row_sums([range(5)], 5), **options).order == 6


@pytest.mark.parametrize("kind", ["random", "leading", "selection"])
def test_compressed_era_in_noise(kind):
    """What T keeps decides the noise: leading directions lose nothing, random ones a decade (recipes: one to two)."""
    from tests.support import add_noise

    noisy = add_noise(RESPONSE, 40.0)
    plain = identify(noisy, method="era", order=N, block_rows=ROWS, block_columns=COLUMNS)
    H = np.block([[noisy.values[i + j] for j in range(COLUMNS)] for i in range(ROWS)])
    T = {
        "random": random_projection(3 * N, SIDE["rows"], seed=0),
        "leading": np.linalg.svd(H)[0].T[: 3 * N],
        "selection": row_selection(range(3 * N), SIDE["rows"]),
    }[kind]
    options = {"order": N, "block_rows": ROWS, "block_columns": COLUMNS, "row_compression": T}
    found = identify(noisy, method="era", **options)
    base, error = (match_poles(r.modes.poles, TRUTH).damping_error for r in (plain, found))
    if kind == "leading":
        assert error == pytest.approx(base, rel=1e-6)
    else:
        assert base < error < 100 * base
