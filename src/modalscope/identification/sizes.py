"""Choose block sizes of the data matrices of records, of joined setups and of windows of samples."""

from __future__ import annotations

import numpy as np

from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import ImpulseResponse
from modalscope.identification.matrices.hankel import MAX_COMPANION_STATES, SHORT_SIDE_SHARE, default_blocks
from modalscope.signals.preprocess.ambient_records import SETUP_ROWS

#: Maximum number of rows of shifted transfer functions, whose triangular factor is complete.
_MAX_WINDOW_ROWS = 600

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

#: Periods of the slowest mode spanned by the lags of joined setups, and minimum number of lags.
_LAG_PERIODS, _MIN_LAGS = 6.0, 40

#: Maximum number of samples of the past for records with inputs, and of rows of their future.
_MAX_DRIVEN_PAST, _MAX_DRIVEN_FUTURE = 120, 800


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
    most = _MAX_WINDOW_ROWS if truncates else MAX_COMPANION_STATES
    wanted = max(-(-3 * order // outputs), 10, min(samples // SHORT_SIDE_SHARE, most // outputs))
    return int(max(min(wanted, samples // 3), 1))


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
