"""Write the measured responses of the hammered beam as a universal file.

    python convert.py beam_mimo_frf.npz beam_hammer.uff

The archive holds `freq` (lines,) in Hz and `H` (hammer points, accelerometers, lines), complex. The universal file
holds the units (dataset 164) and a function (dataset 58, binary) for each pair of an accelerometer and a hammer point.
The bytes are written here because the header of a binary dataset 58 counts the bytes of its payload, and a reader that
takes the count at its word must find it true.
"""

import argparse
from pathlib import Path

import numpy as np

FREQUENCY_RESPONSE = 4
COMPLEX_SINGLE = 5
EVEN_ABSCISSA = 1
LITTLE_ENDIAN, IEEE_754 = 1, 2
FREQUENCY, ACCELERATION, FORCE, UNUSED = 18, 12, 13, 0
PLUS_Z = 3
DELIMITER = b"    -1\n"


def units_si() -> bytes:
    """Dataset 164: metres, newtons; factors to SI are one."""
    lines = (
        "   164",
        f"{1:10d}{'SI: Meter (newton)':<20s}{2:10d}",
        "".join(_fortran_double(value) for value in (1.0, 1.0, 1.0)),
        _fortran_double(273.15),
    )
    return DELIMITER + "\n".join(lines).encode("ascii") + b"\n" + DELIMITER


def frequency_response(values, first, step, *, number, response, reference) -> bytes:
    """Dataset 58b: one function with even abscissa, complex, single precision."""
    payload = np.ascontiguousarray(values, dtype="<c8").tobytes()
    records = (
        "Beam, hammer test, 7 accelerometers and 6 hammer points",
        f"Acceleration at {response} over force at {reference}",
        "NONE",  # date and time: not known
        "Measured by the authors of sdypy-EMA",
        "NONE",
        f"{FREQUENCY_RESPONSE:5d}{number:10d}{0:5d}{0:10d}"
        f" {'NONE':<10s}{response:10d}{PLUS_Z:4d} {'NONE':<10s}{reference:10d}{PLUS_Z:4d}",
        f"{COMPLEX_SINGLE:10d}{len(values):10d}{EVEN_ABSCISSA:10d}{_wide(first)}{_wide(step)}{0.0:13.5E}",
        _axis(FREQUENCY, "Frequency", "Hz"),
        _axis(ACCELERATION, "Acceleration", "m/s^2"),
        _axis(FORCE, "Force", "N"),
        _axis(UNUSED, "NONE", "NONE"),
    )
    header = (
        f"{58:6d}b{LITTLE_ENDIAN:6d}{IEEE_754:6d}{len(records):12d}{len(payload):12d}{0:6d}{0:6d}{0:12d}{0:12d}",
        *records,
    )
    return DELIMITER + "\n".join(header).encode("ascii") + b"\n" + payload + b"\n" + DELIMITER


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit:<20s}"


def _fortran_double(value: float) -> str:
    return f"{value:25.16E}".replace("E", "D")


def _wide(value: float) -> str:
    """Fill the 13 columns of an abscissa field: 1.00020E+00 would shift the last line by 0.05 Hz."""
    text = f"{value:.10f}".rjust(13)
    if len(text) != 13:
        raise ValueError(f"{value} does not fit in 13 columns with ten decimals")
    return text


def convert(source: Path, target: Path) -> None:
    with np.load(source, allow_pickle=False) as archive:
        frequencies, responses = archive["freq"], archive["H"]
    first, step = float(frequencies[0]), float(np.mean(np.diff(frequencies)))
    if not np.allclose(frequencies, first + step * np.arange(len(frequencies)), rtol=0, atol=1e-6):
        raise ValueError("the lines are not evenly spaced")
    if not np.isfinite(responses).all():
        raise ValueError("the responses hold NaN or infinite values")
    sets = [units_si()]
    for j, column in enumerate(responses, start=1):
        for i, values in enumerate(column, start=1):
            sets.append(frequency_response(values, first, step, number=len(sets), response=i, reference=j))
    target.write_bytes(b"".join(sets))
    print(f"{target}: {len(sets) - 1} functions of {len(frequencies)} lines, {target.stat().st_size} bytes")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", type=Path, help="beam_mimo_frf.npz")
    parser.add_argument("target", type=Path, help="universal file to write")
    arguments = parser.parse_args()
    convert(arguments.source, arguments.target)
