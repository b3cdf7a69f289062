"""Records on lines are exact: any input, any first and last state, any runs, any band; what must not be done to a record is not exact."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import DataError, FrequencyResponse, ModalModel, Signals, StateSpace, identify, refine, systems
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.identification.matrices.records import RecordLines, RunColumns, record_lines
from modalscope.identification.matrices.transfer import transfer
from modalscope.identification.modal.eigenmodes import eigenmodes
from modalscope.identification.pipeline import Pipeline
from tests.support import built, match_poles, random_system, relative

#: Poles inside the band, and what follows from them by least squares.
EXACT, FITTED = 1e-9, 1e-8

N = 600


def earthquake(rng: np.random.Generator, samples: int) -> np.ndarray:
    """White noise through a ground filter (15 % at .05 of the rate) under an envelope that rises and falls."""
    ground = StateSpace(A=[[1.85, -0.95], [1.0, 0.0]], B=[[1.0], [0.0]], C=[[0.1, 0.0]], dt=1.0)
    t = np.arange(samples) / samples
    return ground.simulate(rng.standard_normal((samples, 1)))[:, 0] * t * np.exp(-6 * t) * 20


def inputs_of(kind: str, rng: np.random.Generator, samples: int, m: int) -> np.ndarray:
    """Return inputs (samples, m) of a kind; each input at its own times and frequencies."""
    u = np.zeros((samples, m))
    for i in range(m):
        if kind == "white":
            u[:, i] = rng.standard_normal(samples)
        elif kind == "step":
            u[samples // 3 + 7 * i :, i] = 1 + i
        elif kind == "impulse":
            u[11 + 40 * i, i] = 3
        elif kind == "sines":
            u[:, i] = np.sin(np.outer(np.arange(samples), [0.31 + 0.05 * i, 1.07, 2.03 - 0.1 * i])).sum(axis=1)
        else:
            u[:, i] = earthquake(rng, samples)
    return u


def runs_of(
    ss: StateSpace, kind: str, rng: np.random.Generator, lengths: tuple[int, ...] = (N,)
) -> tuple[Records, list[np.ndarray]]:
    """Return runs that begin anywhere, and where they begin."""
    runs, first = [], []
    for samples in lengths:
        u = inputs_of(kind, rng, samples, ss.B.shape[1])
        first.append(3 * rng.standard_normal(ss.order))
        runs.append(Signals(outputs=ss.simulate(u, first[-1]), inputs=u, sampling_rate=1.0))
    return Records(runs=tuple(runs)), first


def poles_of(ss: StateSpace) -> np.ndarray:
    return np.log(np.linalg.eigvals(ss.A).astype(complex))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "step", "impulse", "sines", "earthquake"])
@pytest.mark.parametrize("lengths", [(N,), (401, 556), (700, 333, 512, 410)])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_poles_and_rank_are_exact_for_any_input_any_ends_and_any_runs(
    kind: str, lengths: tuple[int, ...], m: int
) -> None:
    rng = np.random.default_rng(len(lengths) + 10 * m)
    ss = random_system(rng, outputs=3, inputs=m, modes=3, direct=True)
    records, _ = runs_of(ss, kind, rng, lengths)
    p = built(records, 6, method="alternate", block_rows=8, route="records")
    assert p.factors.rank == 6
    found = match_poles(p.matrix.to_s(p.triple(6).eigen().values), poles_of(ss))
    assert max(found.frequency_error, found.damping_error) < EXACT
    # what is excited or not: the records are rebuilt
    modes = eigenmodes(p.matrix, p.triple(6))
    assert modes.participation.shape == (3, m + len(lengths))
    spectra = record_spectra(records)
    assert relative(next(p.matrix.compared(ss, modes.poles, modes.fit))[1], spectra.values) < FITTED
    assert relative(spectra.rebuilt_by(ss).values, spectra.values) < FITTED


#: A companion form has states beyond the rank: what a step gives these is not told from its direct term.
ROWS = [
    (method, kind)
    for method in ("era", "alternate", "least_squares", "polyreference")
    for kind in ("white", "earthquake", "impulse", "step")
    if (method, kind) != ("polyreference", "step")
]


@pytest.mark.parametrize(("method", "kind"), ROWS)
def test_every_row_finds_poles_direct_term_and_participation(method: str, kind: str) -> None:
    rng = np.random.default_rng(7)
    ss = random_system(rng, outputs=3, inputs=2, modes=3, direct=True)
    records, _ = runs_of(ss, kind, rng, (N, 433))
    found = identify(records, method=method, order=6, block_rows=8)
    assert found.settings["route"] == "records"
    match = match_poles(found.poles, poles_of(ss))
    assert max(match.frequency_error, match.damping_error) < EXACT
    assert relative(found.state_space.D, ss.D) < FITTED
    assert relative(found.state_space.markov_parameters(40), ss.markov_parameters(40)) < FITTED
    assert found.fit_error < FITTED


@pytest.mark.parametrize("domain", ["z"])
@pytest.mark.parametrize("band", [(0.05, 0.2), (0.15, 0.45)])
def test_a_band_holds_its_own_modes_exactly(domain: str, band: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    ss = random_system(rng, outputs=4, inputs=2, modes=4)
    records, _ = runs_of(ss, "white", rng, (1200,))
    p = built(records, 8, method="alternate", domain=domain, band=band)
    s = p.matrix.to_s(p.triple(8).eigen().values)
    inside = [pole for pole in poles_of(ss) if band[0] < pole.imag / 2 / np.pi < band[1]]
    assert inside
    assert max(np.abs(s - pole).min() / abs(pole) for pole in inside) < EXACT
    assert max(np.abs(s - pole).min() / abs(pole) for pole in poles_of(ss)) < 1e-6


@pytest.mark.parametrize("method", ["era", "alternate", "least_squares", "polyreference"])
@pytest.mark.parametrize("lengths", [(800,), (640, 910)])
def test_the_s_plane_is_that_of_a_structure_whose_records_are_band_limited(
    method: str, lengths: tuple[int, ...]
) -> None:
    """Lines on which s X = A X + B U + w holds, with nothing beyond the band: what two ends leave over, w, differs from run to run."""
    rng = np.random.default_rng(0)
    ss = random_system(rng, outputs=3, inputs=2, modes=3, sampled=False, direct=True)
    runs = []
    for samples in lengths:
        s, inside = 2j * np.pi * np.arange(samples // 2 + 1) / samples, np.arange(1, int(0.475 * samples))
        U, w = np.zeros((s.size, 2), complex), 5 * rng.standard_normal(6)
        U[inside] = rng.standard_normal((inside.size, 2)) + 1j * rng.standard_normal((inside.size, 2))
        Y = np.zeros((s.size, 3), complex)
        states = np.linalg.solve(s[inside, None, None] * np.eye(6) - ss.A, (U[inside] @ ss.B.T + w)[:, :, None])
        Y[inside] = states[:, :, 0] @ ss.C.T + U[inside] @ ss.D.T
        runs.append(
            Signals(
                outputs=np.fft.irfft(Y, samples, axis=0), inputs=np.fft.irfft(U, samples, axis=0), sampling_rate=1.0
            )
        )
    found = identify(runs, method=method, domain="s", order=6, block_rows=8, band=(0.002, 0.47))
    match = match_poles(found.poles, np.linalg.eigvals(ss.A))
    assert max(match.frequency_error, match.damping_error) < EXACT
    assert relative(found.state_space.D, ss.D) < FITTED
    assert found.state_space.dt is None
    assert found.fit_error < FITTED


def test_first_states_follow_with_the_model() -> None:
    """x X = A X + B U + x (x(0) - x(N)) / sqrt(N): what the ends give to mode j is its left vector times that."""
    rng = np.random.default_rng(5)
    ss = random_system(rng, outputs=3, inputs=2, modes=3)
    records, (first,) = runs_of(ss, "white", rng)
    run = records.runs[0]
    assert run.inputs is not None
    last = first
    for u in run.inputs:
        last = ss.A @ last + ss.B @ u
    p = built(records, 6, method="alternate", block_rows=8)
    modes = eigenmodes(p.matrix, p.triple(6))
    z, X = np.linalg.eig(ss.A)
    ends = np.linalg.solve(X, (first - last) / np.sqrt(run.samples))
    own = np.array([np.argmin(np.abs(z - v)) for v in modes.eigen.values])
    found = modes.shapes * modes.participation[:, 2]
    assert relative(found, (ss.C @ X * ends)[:, own]) < FITTED


def test_a_unit_impulse_at_rest_spans_what_the_transfer_matrix_spans() -> None:
    rng = np.random.default_rng(2)
    ss = random_system(rng, outputs=3, inputs=1, modes=3, damping=(0.03, 0.3))
    samples, q = 4000, 8
    u = np.zeros((samples, 1))
    u[0] = 1
    y = ss.simulate(u)
    ours = record_lines(
        record_spectra(Records(runs=(Signals(outputs=y, inputs=u, sampling_rate=1.0),))), domain="z", block_rows=q
    )
    lines = np.arange(1, samples // 2)
    H = np.fft.rfft(y, axis=0)[lines, :, None]
    frf = FrequencyResponse(values=H, frequencies=lines / samples, sampling_rate=1.0)
    theirs = transfer(frf, domain="z", block_rows=q, order=6, weights=ours.line_weights)
    spans = [np.linalg.svd(matrix.triangle)[0][:, :6] for matrix in (ours, theirs)]
    assert np.abs(np.linalg.svd(spans[0].T @ spans[1], compute_uv=False) - 1).max() < EXACT


def test_runs_keep_the_inputs_that_they_had() -> None:
    """Roving inputs need no square matrix; an input that no run has alike is its own column."""
    rng = np.random.default_rng(4)
    ss = random_system(rng, outputs=3, inputs=3, modes=3, direct=True)
    runs = []
    for own in ([0], [1], [2], [0, 2]):
        u = np.zeros((500, 3))
        u[:, own] = rng.standard_normal((500, len(own)))
        y = ss.simulate(u, rng.standard_normal(ss.order))
        runs.append(Signals(outputs=y, inputs=u[:, own], sampling_rate=1.0, input_dofs=[f"u{i + 1}" for i in own]))
    found = identify(runs, method="alternate", order=6)
    match = match_poles(found.poles, poles_of(ss))
    assert max(match.frequency_error, match.damping_error) < EXACT
    assert relative(found.state_space.D, ss.D) < FITTED
    assert relative(found.state_space.markov_parameters(40), ss.markov_parameters(40)) < FITTED


def test_inputs_that_are_alike_are_left_out_by_rank_with_a_note() -> None:
    rng = np.random.default_rng(6)
    ss = random_system(rng, outputs=3, inputs=1, modes=3)
    u = rng.standard_normal((N, 1))
    y = ss.simulate(u, rng.standard_normal(ss.order))
    found = identify(Signals(outputs=y, inputs=np.hstack([u, -2 * u]), sampling_rate=1.0), order=6, block_rows=8)
    match = match_poles(found.poles, poles_of(ss))
    assert max(match.frequency_error, match.damping_error) < EXACT
    assert any("9 of 27 rows" in str(note) for note in found.notes)
    assert any("inputs u1, u2 are zero or depend on each other" in str(note) for note in found.notes)
    assert found.fit_error < FITTED
    # only u1 - 2 u2 was driven: what it gives is known, how it is shared is not
    both = found.state_space.markov_parameters(20) @ [[1.0], [-2.0]]
    assert relative(both, ss.markov_parameters(20)) < FITTED


def test_driving_points_whose_inputs_are_not_told_apart_give_no_modal_mass() -> None:
    """Shares of inputs that are alike are the shortest that fit: a mass from them would be wrong; a force of its own gives the true one."""
    chain = systems.chain5()
    ss, true = chain.state_space(dt=0.05), chain.modes().normalized("mass")
    u = np.random.default_rng(0).standard_normal((1500, 2))
    labels = {
        "output_dofs": chain.modes().output_dofs,
        "input_dofs": chain.modes().input_dofs,
        "quantities": "displacement",
    }

    def modes_under(forces: np.ndarray) -> ModalModel:
        record = Signals(outputs=ss.simulate(forces), inputs=forces, sampling_rate=20.0, **labels)
        return identify(record, order=10, block_rows=8).modes

    alike = modes_under(u[:, :1] * [1.0, 2.0])
    with pytest.raises(DataError, match=r"2:\+X, 5:\+X are inputs whose shares.*\n.*independent force"):
        alike.normalized("mass")
    with pytest.raises(DataError, match=r"5:\+X are inputs whose shares"):
        alike.select(inputs=["5:+X"]).normalized("mass")
    alone = modes_under(u * [1.0, 0.0]).normalized("mass")  # the other driving point is enough
    assert alone.scaling == "unit modal mass, driving point 2:+X"
    assert (
        relative(np.abs(alone.shapes), np.abs(true.shapes)) < FITTED
    )  # held forces, whose residues are dt times as large


@pytest.mark.parametrize("third", [0.0, 3.0])
def test_a_refinement_gives_nothing_to_what_inputs_do_not_excite(third: float) -> None:
    """An input of zeros has no participation, and one that is three times the first half of what both give: the shortest vector."""
    rng = np.random.default_rng(6)
    ss = random_system(rng, outputs=3, inputs=2, modes=3)
    u = rng.standard_normal((N, 2))
    y = ss.simulate(u) + 0.01 * rng.standard_normal((N, 3))
    of = [Signals(outputs=y, inputs=inputs, sampling_rate=1.0) for inputs in (u, np.column_stack([u, third * u[:, 0]]))]
    two, three = (refine(data, identify(data, order=6, block_rows=8).modes) for data in of)
    assert np.allclose(three.poles, two.poles, rtol=1e-6)
    shared = three.participation @ [[1.0, 0.0], [0.0, 1.0], [third, 0.0]]
    assert np.allclose(
        third * three.participation[:, 2], (third > 0) * three.participation[:, 0], rtol=1e-9, atol=1e-12
    )
    assert np.all((third > 0) | (three.participation[:, 2] == 0))
    assert np.allclose(residues(three.shapes, shared), residues(two.shapes, two.participation), rtol=1e-3, atol=1e-4)


def test_the_shortest_participation_explains_the_same() -> None:
    """Of an input and another that is three times as large each has half of what both give."""
    rng = np.random.default_rng(7)
    u = rng.standard_normal((N, 2))
    record = Signals(outputs=u, inputs=np.column_stack([u, 3 * u[:, 0]]), sampling_rate=1.0)
    given = rng.standard_normal((4, 3))
    found = record_spectra(Records(runs=(record,))).shortest_participation(given)
    both = [[1.0, 0.0], [0.0, 1.0], [3.0, 0.0]]
    assert np.allclose(found @ both, given @ both, rtol=1e-9)
    assert np.allclose(3 * found[:, 2], found[:, 0], rtol=1e-9)


def residues(shapes: np.ndarray, participation: np.ndarray) -> np.ndarray:
    return np.asarray(shapes.T[:, :, None] * participation[:, None, :])


def test_what_must_not_be_done_to_a_record_is_not_exact() -> None:
    """An offset costs nothing, for 0 Hz is left out; a window or zeros behind the record cost the damping."""
    rng = np.random.default_rng(8)
    ss = random_system(rng, outputs=3, inputs=1, modes=3, damping=(0.003, 0.02))
    u = rng.standard_normal((N, 1))
    y = ss.simulate(u, rng.standard_normal(ss.order))

    def error(outputs: np.ndarray, inputs: np.ndarray) -> float:
        found = identify(Signals(outputs=outputs, inputs=inputs, sampling_rate=1.0), order=6, block_rows=8)
        return match_poles(found.poles, poles_of(ss)).damping_error

    assert error(y + 5, u - 3) < EXACT
    hann = np.hanning(N)[:, None]
    assert error(hann * y, hann * u) > 0.01
    assert error(np.vstack([y, 0 * y]), np.vstack([u, 0 * u])) > 0.01


def test_a_drift_is_one_pole_more_and_a_delay_as_many_as_its_samples() -> None:
    rng = np.random.default_rng(9)
    ss = random_system(rng, outputs=3, inputs=1, modes=3, damping=(0.003, 0.02))
    u = rng.standard_normal((N, 1))
    y = ss.simulate(u, rng.standard_normal(ss.order))
    drift = Signals(outputs=y + np.outer(np.arange(N) / N, [1, 2, -1]), inputs=u, sampling_rate=1.0)
    found = identify(drift, order=7, block_rows=8)
    s = found.modes.poles
    assert np.abs(s).min() < 1e-6
    assert max(np.abs(s - pole).min() / abs(pole) for pole in poles_of(ss) if pole.imag > 0) < EXACT
    late = y.copy()
    late[2:, 0], late[:2, 0] = y[:-2, 0], rng.standard_normal(2)
    found = identify(Signals(outputs=late, inputs=u, sampling_rate=1.0), order=8, block_rows=8)
    oscillating = found.modes.poles[found.modes.poles.imag > 1e-3]
    assert max(np.abs(oscillating - pole).min() / abs(pole) for pole in poles_of(ss) if pole.imag > 0) < 1e-8


def test_chunks_of_lines_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    ss = random_system(rng, outputs=2, inputs=1, modes=2)
    records, _ = runs_of(ss, "white", rng, (2001,))
    spectra = record_spectra(records)
    whole = record_lines(spectra, domain="z", block_rows=5)
    basis = spectra.basis(poles_of(ss))
    monkeypatch.setattr("modalscope.identification.matrices.records._BLOCK_NUMBERS", 512)
    monkeypatch.setattr("modalscope.identification.fast.record_influence._BLOCK_NUMBERS", 512)
    monkeypatch.setattr("modalscope.numerics.functions.driven_basis._COMPRESSED_NUMBERS", 2048)
    pieces = record_lines(spectra, domain="z", block_rows=5)
    assert relative(pieces.triangle @ pieces.triangle.T, whole.triangle @ whole.triangle.T) < 1e-12
    again = spectra.basis(poles_of(ss))
    shapes = random_shapes(rng)
    assert relative(again.fit_participation(shapes)[0], basis.fit_participation(shapes)[0]) < FITTED


def random_shapes(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal((2, 4)) + 1j * rng.standard_normal((2, 4))


def test_too_few_lines_are_an_error_that_says_how_many_are_left() -> None:
    rng = np.random.default_rng(1)
    y, u = rng.standard_normal((40, 2)), rng.standard_normal((40, 1))
    record = Signals(outputs=y, inputs=u, sampling_rate=1.0)
    with pytest.raises(DataError, match=r"19 lines leave -?\d+ equations"):
        record_lines(record_spectra(Records(runs=(record,))), domain="z", block_rows=18, order=6)
    with pytest.raises(DataError, match="no line lies there"):
        record_spectra(Records(runs=(record,)), (0.6, 0.7))


def test_the_matrix_says_what_it_is() -> None:
    rng = np.random.default_rng(1)
    record = Signals(outputs=rng.standard_normal((100, 2)), inputs=rng.standard_normal((100, 1)), sampling_rate=1.0)
    matrix = record_lines(record_spectra(Records(runs=(record, record))), domain="z", block_rows=3)
    assert isinstance(matrix, RecordLines)
    assert "2 runs on 98 lines, 0.01 to 0.49 Hz, polynomials to degree 3" in matrix.describe()
    assert matrix.left == 2 * (2 * 49 - 2 * 4)
    assert isinstance(built(record, 2), Pipeline)


def test_lines_are_weighted_by_the_resonances_and_white_noise_stays_white() -> None:
    """The stacked polynomials are orthonormal as they stand in the rows: what is white on the lines is white in the blocks."""
    rng = np.random.default_rng(4)
    ss = random_system(rng, outputs=3, inputs=1, modes=2, damping=(0.002, 0.005))
    u = rng.standard_normal((3000, 1))
    spectra = record_spectra(Records(runs=(Signals(outputs=ss.simulate(u), inputs=u, sampling_rate=1.0),)))
    matrix = record_lines(spectra, domain="z", block_rows=12)
    rows = np.vstack([columns[:, :13] for _, columns in RunColumns(matrix, matrix.spans[0]).rows()])
    assert np.abs(rows.T @ rows - np.eye(13)).max() < 1e-12
    assert np.mean(matrix.line_weights**2) == pytest.approx(1)
    at = np.abs(np.log(poles_of(ss)).imag) / (2 * np.pi)
    near = np.min(np.abs(spectra.frequencies[:, None] - at), axis=1) < 0.002
    assert matrix.line_weights[near].min() > 1.3 * np.median(matrix.line_weights)
