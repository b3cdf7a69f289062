"""Choose block sizes of data matrices from the number of samples or lines, the channels and the largest order."""

from __future__ import annotations

import numpy as np

from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.identification.matrices.block_hankel import BlockHankel
from modalscope.identification.matrices.combinations import enough
from modalscope.identification.matrices.costs import costs_of

#: The short side of a truncation spans one in so many samples: a sixth, see `default_windows`.
_SHORT_SIDE_SHARE = 6

#: Maximum number of rows on the short side of a Hankel matrix of samples, and on the long side.
_MAX_SHORT_ROWS, _MAX_LONG_ROWS = 33_000, 67_000

#: Variances within this factor count as equal; the long side becomes rows where that saves this many operations: five milliseconds.
_SAME_PRECISION, _MIN_SAVED_OPERATIONS = 2.0, 2e8

#: Maximum number of rows of shifted transfer functions, whose triangular factor is complete.
_MAX_WINDOW_ROWS = 600

#: Maximum number of rows of transfer functions on lines, whose cube counts, and of rows times lines. Rows and degree that are always
#: allowed.
_MAX_LINE_ROWS, _MAX_LINE_NUMBERS, _CHEAP_ROWS, _CHEAP_DEGREE = 800, 1_500_000, 600, 48

#: Maximum number of states of a companion form, whose eigenvalues cost their cube.
_MAX_COMPANION_STATES = 240

#: Maximum ratio of rows of the past to times: prediction by chance lowers damping by 3 % at this ratio, by 12 % at 8 %.
_MAX_PAST_SHARE = 0.02

#: Maximum number of columns of the stack of records on lines, and maximum degree.
_MAX_STACK_COLUMNS, _MAX_DEGREE = 1400, 100

#: Maximum share of the data in the eliminated terms of inputs and ends: standard deviations grow by 1 / sqrt(1 - share), by 29 % at
#: most, while a degree that does not resolve the slowest mode costs several times as much.
_MAX_ELIMINATED_SHARE = 0.4

#: Maximum number of products of columns over all lines, 2 F columns^2: some twenty seconds at 40 a nanosecond.
_MAX_PRODUCTS = 8e11

#: Maximum number of rows of the past, for the time of the triangular factor.
_MAX_PAST_ROWS = 600

#: Maximum number of rows of a matrix of joined setups.
SETUP_ROWS = 1300

#: Periods of the slowest mode spanned by the lags of joined setups, and minimum number of lags.
_LAG_PERIODS, _MIN_LAGS = 6.0, 40

#: Maximum number of samples of the past for records with inputs, and of rows of their future.
_MAX_DRIVEN_PAST, _MAX_DRIVEN_FUTURE = 120, 800


def default_windows(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return block sizes of a truncation: one side spans a sixth of the samples, the other all the rest.

    With r blocks on the shorter side and s on the longer one, the pole of a mode that does not fade is the difference of two means over r
    samples that lie s apart, whichever side is which: its variance is N^3 / (6 r s^2) times the least that N samples allow. That is 1.125
    at a third, 1.44 at a sixth (deviations 1.2 times the least) and 5.4 at a thirtieth of the samples; samples that are not read cost the
    power of three. Where a mode fades the vectors on both sides fade with it, so that blocks beyond its life add no noise of first
    order, and the bound itself is reached. Never fewer rows, or columns, than three times as many as states.

    Rows are the short side, whose shapes tell close modes apart, unless columns there cost less: of many outputs the Gram matrix of a
    short side of inputs is a small one. Of T rows and columns in all, l r + m s, a third belongs to the short side, where r s^2 is
    largest; of very long records that are held to it, the way is taken that is twice as precise. What is given is kept, and the other
    side reads the rest. Correlations have errors that do not fade; see `default_blocks`.

    `block_rows`, `block_columns`: as given.
    """
    if response.ambient:
        return default_blocks(response, order, block_rows, block_columns)
    samples, channels, inputs = response.values.shape
    outputs = enough(channels, order) or channels
    lying = _spans(samples, (outputs, inputs), order, (block_rows, block_columns))
    standing = _spans(samples, (inputs, outputs), order, (block_columns, block_rows))[::-1]
    if block_rows is not None or block_columns is not None:
        return lying if block_rows is not None else standing
    rough, precise = sorted((lying, standing), key=lambda sizes: _precision(*sizes))
    if _precision(*rough) * _SAME_PRECISION <= _precision(*precise):
        return precise
    like = np.broadcast_to(0.0, (samples, outputs, inputs))
    costs = [costs_of(BlockHankel(like, *sizes), order)[0] for sizes in (lying, standing)]
    saved = costs[0].operations - costs[0].passing - costs[1].operations + costs[1].passing
    return standing if saved > _MIN_SAVED_OPERATIONS else lying


def _precision(rows: int, columns: int) -> float:
    """Return r s^2, r the shorter and s the longer side: one over the variance of a pole, but for a factor."""
    return float(min(rows, columns) * max(rows, columns) ** 2)


def _spans(
    samples: int,
    channels: tuple[int, int],
    order: int,
    given: tuple[int | None, int | None],
    most: int = _MAX_SHORT_ROWS,
) -> tuple[int, int]:
    """Return blocks on the short side and on the long one, of so many channels each; `most` rows in all on the short side."""
    short, long = given
    least = min(max(-(-3 * order // channels[0]), 10), max(samples // 2, 1))
    room = samples if long is None else max(samples - long, 1)
    short = short or min(max(min(samples // _SHORT_SIDE_SHARE, most // channels[0]), least), room)
    return short, long or max(min(samples - short, max(_MAX_LONG_ROWS // channels[1], short)), 1)


def companion_windows(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return those of a truncation whose block rows are all states, 240 of them at most, or three times the order."""
    if response.ambient:
        return default_blocks(response, order, block_rows, block_columns)
    samples, channels, inputs = response.values.shape
    outputs = enough(channels, order) or channels
    return _spans(samples, (outputs, inputs), order, (block_rows, block_columns), _MAX_COMPANION_STATES)


def default_blocks(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return block sizes of correlations, and of regressions without truncation, into which noise comes in squares.

    Three times as many rows as states, and the rest of the samples, up to twenty times, as columns. Both are at least ten blocks where
    the samples allow it. Correlations get four times as many columns as rows and at least eighty: their errors do not fade with the lag
    as the modes do, so that long ones harm.
    """
    samples, outputs, inputs = response.values.shape
    room = samples if block_columns is None else max(samples - block_columns, 1)
    rows = block_rows or min(max(-(-3 * order // outputs), 10), max(samples // 2, 1), room)
    ample = max(4 * rows, 80) if response.ambient else max(-(-20 * order // inputs), rows, 10)
    columns = block_columns or max(min(samples - rows, ample), 1)
    return rows, columns


def setup_blocks(response: ImpulseResponse, lowest: float | None = None) -> dict[str, int]:
    """Return block sizes of joined setups: lags over six periods of the slowest mode, as far as something is heard, a quarter as rows.

    Errors of correlations are as large at all lags and modes are not, so that long records do not ask for longer lags: up to where they
    fade, weak and close modes are lost (docs/setups.md). No more rows than 1300 in all, which a Gram matrix bears, and never fewer than
    ten blocks.

    `response`: its lags end where nothing is heard. `lowest`: hz: where the slowest mode stands out; all lags without it.
    """
    samples = response.samples
    length = samples if lowest is None else min(int(_LAG_PERIODS * response.sampling_rate / lowest), samples)
    lags = max(length, min(_MIN_LAGS, samples))
    rows = max(min(lags // 4, SETUP_ROWS // response.values.shape[1]), min(10, samples // 2), 1)
    return {"block_rows": rows, "block_columns": max(min(lags, samples - 1) - rows, 1)}


def default_projection(
    records: Signals, correlation: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return block sizes of projected records: the lags that their correlation would have, half for the past and half for the future.

    A long past is predicted from by chance as well: of short records and of many channels it is shorter, and the future with it,
    down to the block rows of a correlation.
    """
    least, lags = default_blocks(correlation, order, None, None)
    outputs = len(records.output_dofs)
    most = min(_MAX_PAST_SHARE * records.runs * records.samples, _MAX_PAST_ROWS) / outputs
    alike = max(min((least + lags) // 2, int(most)), least)
    return block_rows or alike, block_columns or alike


def default_shifts(response: Response, order: int, *, truncates: bool = True) -> int:
    """Return a sixth of the samples (see `default_windows`), 600 rows in all at most, 240 where all rows are states.

    But three times as many rows as states and ten blocks at least, and never more than a third of the samples.
    """
    outputs, samples = response.values.shape[1], response.as_samples().response.count
    most = _MAX_WINDOW_ROWS if truncates else _MAX_COMPANION_STATES
    wanted = max(-(-3 * order // outputs), 10, min(samples // _SHORT_SIDE_SHARE, most // outputs))
    return int(max(min(wanted, samples // 3), 1))


def default_degree(response: FrequencyResponse, order: int, *, truncates: bool = True) -> int:
    """Return the degree q: a third of the lines, less where there are many lines and outputs.

    Real and imaginary parts of F lines are N = 2 F numbers, and the degree stands for the block rows of samples: with q = N / 6 the
    deviations are 1.2 times the least in z (see `default_windows`). In s, where polynomials have 2 / pi of the zeros in the middle of the
    band, it is 1.4 there; with many more they would be as many as the lines, and take away all there is, beyond sqrt(1 - (q / N)^2) of it.
    Work goes with lines times squared rows and with their cube: no more than 800 rows, and 1.5 million rows times lines, but up to 600 rows
    and a degree of 48 always. The variance goes with 1 / rows: 2000 lines give 1.7 times the least, 48 gave 3 times. Where all block rows
    are states there are 240 of them, or as many as a degree of 48 has. Never fewer than 8 and what the order needs.

    `truncates`: whether directions are cut off, so that more rows are no more states.
    """
    lines, outputs, inputs = response.values.shape
    most = min(_MAX_LINE_ROWS, _MAX_LINE_NUMBERS // lines) if truncates else _MAX_COMPANION_STATES
    rows = max(most, min(_CHEAP_ROWS, _CHEAP_DEGREE * outputs))
    wanted = max(min(2 * lines // _SHORT_SIDE_SHARE, rows // outputs), 8, -(-order // outputs) + 1)
    carried = (2 * lines * inputs - order) // inputs - 1
    return int(max(min(wanted, carried), 1))


def default_record_degree(spectra: RecordSpectra, order: int, *, truncates: bool = True) -> int:
    """Return the degree q of records on lines: as high as the stack and the lines allow, for it decides how well damping is known.

    (q + 1)(1 + m + l) stays below 1400 columns, and below what takes half a minute on the lines of a long record, and the terms that are
    eliminated take no more than two fifths of the data; but q is never below 8, nor below what the order needs, unless the lines forbid
    it: q + 1 terms of every input and end, and the order, must be left.
    Where all block rows are states, there are no more of them than the order needs.
    """
    _, outputs, _ = spectra.values.shape
    channels, terms = spectra.eliminated
    least = max(8, -(-order // outputs) + 4)
    stack = int(min(_MAX_STACK_COLUMNS, np.sqrt(_MAX_PRODUCTS / (2 * spectra.count))))
    wanted = (
        least
        if not truncates
        else min(
            _MAX_DEGREE, stack // (channels + outputs) - 1, int(2 * _MAX_ELIMINATED_SHARE * spectra.count / terms) - 1
        )
    )
    most = (2 * spectra.count - order) // terms - 1
    return int(max(min(max(wanted, least), most), -(-order // outputs), 1))


def default_driven(
    records: Records, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int, int]:
    """Return block rows, samples of the past and how many of these stay one by one, of records with inputs.

    A long future steadies damping: as many block rows as have up to 800 rows with the inputs, and half as many rows as times in all. The
    past reaches 120 samples back, or a twentieth of a run, but has few rows: one by one only what the order needs.
    """
    outputs, inputs = len(records.output_dofs), len(records.input_dofs)
    least = -(-order // outputs) + 1
    past = block_columns or max(min(_MAX_DRIVEN_PAST, min(records.samples) // 20), least)
    single = min(max(-(-order // (outputs + inputs)) + 1, 4), past)
    rows = (single + 2.5 * np.log1p(past / 2)) * (outputs + inputs)  # about: intervals grow by a half
    room = (sum(records.samples) / 2 - rows) / (outputs + inputs)
    future = block_rows or max(min(100, _MAX_DRIVEN_FUTURE // (outputs + inputs), int(room)), least)
    return future, past, single
