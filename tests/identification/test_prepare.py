"""From data of any kind to the response that a method's domain needs, with a note of every conversion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope import DataError
from modalscope.data import FrequencyResponse, ImpulseResponse, Records, Signals
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import as_records
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_upright
from modalscope.identification.identify import identify
from modalscope.identification.method_names import find_method, methods
from modalscope.identification.prepare import measure, pose, prepare
from modalscope.identification.suits import served_by
from modalscope.signals.preprocess import decimate, detrend, estimate_correlation
from modalscope.signals.preprocess.ambient_records import looked_through
from modalscope.signals.preprocess.excitation import find_excitation
from modalscope.systems import chain5
from tests.support import built

RNG = np.random.default_rng(0)


def samples(**how: object) -> ImpulseResponse:
    k = np.arange(64)[:, None, None]
    return ImpulseResponse(
        values=np.exp(-0.2 * k) * np.outer([3, 1, -1], [1, 2]),
        sampling_rate=50.0,
        **how,  # type: ignore[arg-type]
    )


def lines(rate: float | None = None, first: float = 0.0) -> FrequencyResponse:
    f = np.linspace(first, 25, 51)
    H = np.outer([3, 1, -1], [1, 2]) / (2j * np.pi * f[:, None, None] + 6)
    # the last line of a sampled system is real, and so is that at 0 Hz
    H[-1], H[0] = H[-1].real, H[0].real
    return FrequencyResponse(values=H, frequencies=f, sampling_rate=rate)


def records(inputs: bool) -> Signals:
    return Signals(
        outputs=RNG.standard_normal((4000, 2)),
        inputs=RNG.standard_normal((4000, 3)) if inputs else None,
        sampling_rate=50.0,
    )


def cell(data: Signals | ImpulseResponse | FrequencyResponse, method: str | None = None, domain: str | None = None):  # type: ignore[no-untyped-def]
    found = prepare(data, method, domain).method
    return found.name, found.domain


def test_the_method_and_its_domain_are_those_that_suit_the_data() -> None:
    assert cell(samples()) == ("era", "time")
    assert cell(samples(kind="correlation")) == ("era", "time")
    assert cell(lines()) == ("alternate", "s")
    assert cell(lines(rate=50.0)) == ("alternate", "z")
    assert cell(records(inputs=False)) == ("alternate", "time")
    assert cell(records(inputs=True)) == ("alternate", "z")


def test_a_method_asked_for_is_taken_in_the_domain_of_the_data_and_a_domain_with_the_default_method() -> None:
    assert cell(lines(), "era") == ("era", "s")
    assert cell(lines(), None, "z") == ("alternate", "z")
    assert cell(samples(), "polyreference", "z") == ("polyreference", "z")
    assert cell(lines(), "prce") == ("prce", "time")  # the row has only this one


def test_what_suits_is_handed_on_as_it_is() -> None:
    for data in (samples(), lines()):
        found = prepare(data, None, None)
        assert found.response is data
        assert (found.records, found.notes) == (None, ())


def test_records_with_inputs_stay_records_on_their_own_lines() -> None:
    data = records(inputs=True)
    found = prepare(data, None, None)
    assert isinstance(found.response, RecordSpectra)
    assert found.response.values.shape == (1999, 2, 1)  # 4000 samples without 0 Hz and half the rate
    assert found.options.route == "records"
    assert prepare([data, data], None, None).response.durations == (80.0, 80.0)


@pytest.mark.parametrize(
    ("method", "domain", "route"),
    [
        (None, None, "records"),
        (None, "s", "records"),
        ("era", "z", "records"),
        ("era", "time", "markov"),
        ("lscf", None, "frf"),
        ("prce", None, "frf"),
        ("polymax", None, "frf"),
        ("ssi-cov", "time", "markov"),
    ],
)
def test_a_method_given_with_a_domain_takes_the_way_that_serves_it(method, domain, route) -> None:  # type: ignore[no-untyped-def]
    found = prepare(records(inputs=True), method, domain)
    assert found.options.route == route
    assert served_by(found.method, route)


def test_the_way_can_be_asked_for_and_one_that_ends_nowhere_says_so() -> None:
    data = records(inputs=True)
    assert str(prepare(data, route="frf").method) == "alternate (s)"
    assert str(prepare(data, route="records", domain="s").method) == "alternate (s, records)"
    with pytest.raises(DataError, match=r"by route='records': .* by route .frf"):
        prepare(data, "lscf", None, route="records")
    with pytest.raises(DataError, match="not records with inputs"):
        prepare(samples(), route="records")
    with pytest.raises(DataError, match="are records with inputs, not records without inputs"):
        prepare(data, route="correlation")
    with pytest.raises(DataError, match="route='recods'"):
        prepare(data, route="recods")


def test_records_with_inputs_become_frequency_responses_of_all_pairs_where_that_is_asked() -> None:
    found = prepare(records(inputs=True), None, None, route="frf")
    assert isinstance(found.response, FrequencyResponse)
    assert found.response.values.shape[1:] == (2, 3)
    assert found.records is None
    assert [str(n) for n in found.notes] == [
        "Taken as a test with measured forces: frequency responses were estimated from the records (H1)"
    ]


def test_records_without_inputs_become_correlations_and_stay_beside_them() -> None:
    data = records(inputs=False)
    found = prepare(data, "ssi-data", None)
    assert isinstance(found.response, ImpulseResponse)
    assert (found.response.kind, found.response.values.shape[1:]) == ("correlation", (2, 2))
    assert np.array_equal(found.records.outputs, detrend(data).outputs)
    assert [note.kind for note in found.notes] == ["noise alone", "estimated"]  # they are random numbers


def test_records_of_a_band_are_slowed_down_before_anything_is_estimated() -> None:
    data = records(inputs=False)
    found = prepare(data, "ssi-data", None, band=(1.0, 3.0))
    slower = decimate(detrend(data), 4)  # of 50 samples a second four are left for a period at 3 Hz
    assert found.records is not None
    assert np.array_equal(found.records.outputs, slower.outputs)
    assert np.array_equal(found.response.values, estimate_correlation(slower).values)


def test_lines_of_a_band_are_cut_to_it() -> None:
    found = prepare(lines(), None, None, band=(5.0, 10.0)).response
    assert isinstance(found, FrequencyResponse)
    assert (found.frequencies[0], found.frequencies[-1]) == (5.0, 10.0)
    # samples are not cut: their band is kept for the diagram
    data = samples()
    assert prepare(data, None, None, band=(5.0, 10.0)).response is data


def test_lines_become_samples_for_a_method_of_the_time_domain() -> None:
    data = lines(rate=50.0)
    found = prepare(data, "era", "time")
    assert isinstance(found.response, ImpulseResponse)
    assert np.allclose(found.response.values, data.to_impulse_response().values)
    assert len(found.notes) == 1
    assert "transformed to samples" in str(found.notes[0])


def test_samples_become_lines_for_a_matrix_fraction_and_for_it_alone() -> None:
    data = samples()
    found = prepare(data, "lscf", None, band=(5.0, 10.0))
    assert isinstance(found.response, FrequencyResponse)
    assert np.allclose(found.response.values, data.to_frequency_response().band(5, 10).values)
    assert found.response.frequencies[0] >= 5
    assert found.response.frequencies[-1] <= 10
    assert [str(n) for n in found.notes] == [
        "the samples were transformed to lines as if nothing followed the last one"
    ]
    assert prepare(data, "era", "z").response is data


def test_an_exponential_window_goes_with_the_response_through_every_conversion() -> None:
    assert prepare(samples(added_damping=2.0), "lscf", None).response.added_damping == 2.0
    windowed = replace(lines(rate=50.0), added_damping=2.0)
    assert prepare(windowed, "era", "time", band=(0.0, 25.0)).response.added_damping == 2.0


def test_samples_have_no_rational_function_of_frequency() -> None:
    with pytest.raises(DataError, match="no rational transform in j w"):
        prepare(samples(), "era", "s")


def test_a_method_of_records_needs_them_without_inputs() -> None:
    with pytest.raises(DataError, match="this is records with inputs"):
        prepare(records(inputs=True), "ssi-data", None)
    with pytest.raises(DataError, match="this is ImpulseResponse"):
        prepare(samples(), "ssi-data", None)


@pytest.mark.parametrize(
    ("place", "words"), [((slice(None), 2), "output 3 is zero"), ((slice(None), slice(None), 1), "input 2 is zero")]
)
def test_a_channel_of_zeros_is_named_with_its_side(place: tuple[object, ...], words: str) -> None:
    data = samples(output_dofs=("1", "2", "3"), input_dofs=("1", "2"))
    values = np.array(data.values)
    values[place] = 0
    with pytest.raises(DataError, match=words) as error:
        prepare(replace(data, values=values), None, None)
    assert f"exclude=['{words.split()[1]}']" in str(error.value)


def test_where_all_is_zero_no_channel_is_to_be_left_out() -> None:
    with pytest.raises(DataError, match="Check cables"):
        measure(Signals(outputs=np.zeros((4000, 2)), sampling_rate=50.0))


def test_forces_none_of_which_changes_are_left_out_first() -> None:
    """Without a force it is ambient vibration; beside others one that rests stays, and hits are hits all the same."""
    moving = records(inputs=True)
    level = np.full((4000, 1), 0.1)
    more = Signals(outputs=moving.outputs, inputs=np.hstack([level, moving.inputs]), sampling_rate=50.0)
    assert measure(more).response.input_dofs == ("u1", "u2", "u3", "u4")
    assert measure(more, exclude=["u1"]).response.input_dofs == ("u2", "u3", "u4")
    struck = Signals(outputs=moving.outputs, inputs=np.hstack([level, np.eye(4000, 1, -9)]), sampling_rate=50.0)
    assert find_excitation(struck) == "impact"
    resting = Signals(outputs=moving.outputs, inputs=level, sampling_rate=50.0)
    for data in (resting, Records(runs=(resting, resting))):
        for exclude in (None, ["u1"], [2]):  # by label, and counted from zero, outputs first
            left = measure(data, exclude=exclude)
            assert left.response.ambient
            assert left.notes[0].kind == "dead force"
    with pytest.raises(DataError, match="not records with inputs"):
        measure(resting, route="records")


def test_a_run_in_which_a_force_rests_stays() -> None:
    moving = records(inputs=True)
    rest = replace(moving, inputs=np.zeros((4000, 3)))
    driven = measure(Records(runs=(moving, rest))).driven
    assert driven is not None
    assert len(driven.runs) == 2


def test_a_single_pair_of_zeros_is_no_dead_channel() -> None:
    values = np.array(samples().values)
    values[:, 2, 1] = 0
    data = replace(samples(), values=values)
    assert prepare(data, None, None).response is data


def test_other_things_are_no_data() -> None:
    with pytest.raises(DataError, match="got ndarray"):
        prepare(np.ones(3), None, None)  # type: ignore[arg-type]


def test_lags_of_a_correlation_that_no_block_holds_are_left_out() -> None:
    found = built(samples(kind="correlation"), order=1, method="era", block_rows=5, block_columns=9)
    assert isinstance(found.response, ImpulseResponse)
    assert found.response.samples == 14
    assert "14 of 64 lags are used" in [str(n) for n in found.notes]
    # other samples stay, whatever the blocks read
    rest = built(samples(), order=1, method="era", block_rows=5, block_columns=9).response
    assert isinstance(rest, ImpulseResponse)
    assert rest.samples == 64


def test_what_makes_a_row_cannot_be_another_thing() -> None:
    row = replace(find_method("era", None, "time"), fixed={"block_rows": 5})
    assert pose(measure(samples()), row, {"block_rows": 5}).options.block_rows == 5
    assert pose(measure(samples()), row, {}).options.block_rows == 5
    with pytest.raises(DataError, match="fixes block_rows=5"):
        pose(measure(samples()), row, {"block_rows": 6})


def test_an_option_of_other_rows_is_refused_with_those_that_have_it() -> None:
    with pytest.raises(DataError, match="works on samples") as error:
        prepare(samples(), "era", None, weights="level")
    having = error.value.change.removesuffix(".").split(": ")[1].split(", ")
    assert having == [str(m) for m in methods() if hasattr(m.options_type, "weights")]
    assert "era (z)" in having
    assert "era (time)" not in having


@pytest.mark.parametrize("form", ["controllable", "smaller"])
def test_lines_have_no_form_but_the_observable_one(form: str) -> None:
    with pytest.raises(DataError, match=r"in domain 's': it has only observable"):
        prepare(lines(), "era", "s", form=form)
    assert prepare(lines(), "era", "s", form="observable").options.form == "observable"
    assert prepare(samples(), "era", "time", form=form).options.form == form


@pytest.mark.parametrize("data", [samples(), records(inputs=True), records(inputs=False), lines(rate=50.0)])
def test_above_half_the_sampling_rate_there_is_nothing(data: Signals | ImpulseResponse | FrequencyResponse) -> None:
    with pytest.raises(DataError, match="nothing lies above 25 Hz"):
        measure(data, (25.0, 30.0))
    with pytest.raises(DataError, match="nothing lies above 25 Hz"):
        measure(looked_through(data), (25.0, 30.0))


def test_more_outputs_than_samples_are_asked_about_where_nothing_names_them() -> None:
    y = RNG.standard_normal((5, 4000))
    for inputs in (None, y[:, :1]):
        wide = Signals(outputs=y, inputs=inputs, sampling_rate=50.0)
        for look in (measure, looked_through) if inputs is None else (measure,):
            with pytest.raises(DataError, match="as well be 5 outputs of 4000 samples"):
                look(wide)
    check_upright(as_records(replace(wide, output_dofs=[f"pixel {k}" for k in range(4000)])))
    check_upright(as_records(replace(wide, source_path="camera.npz")))
    check_upright(as_records(Signals(outputs=RNG.standard_normal((5, 5)), sampling_rate=50.0)))
    with pytest.raises(DataError, match=r"y\.T"):
        check_upright(as_records(Signals(outputs=RNG.standard_normal((5, 6)), sampling_rate=50.0)))


def test_beside_a_size_that_is_given_no_default_of_joined_setups_is_taken() -> None:
    record = chain5().simulate(duration=120, sampling_rate=8)
    labels = ("a", "b", "c", "d")
    parts = [
        Signals(outputs=record.outputs[:, kept], sampling_rate=8.0, output_dofs=tuple(labels[k] for k in kept))
        for kept in ([0, 1, 2], [0, 1, 3])
    ]
    setups = Setups(parts=parts, references=("a", "b"))
    usual = prepare(setups, method="era").options
    assert usual.block_rows is not None
    assert usual.block_columns is not None
    given = prepare(setups, method="era", block_rows=16).options
    assert (given.block_rows, given.block_columns) == (16, None)
    found = identify(setups, method="era", block_rows=16, order=10)
    assert found.settings.block_rows == 16
