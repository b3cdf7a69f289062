"""Identify the modes of a measured beam and compare them with the published ones; only the band is set."""

import csv
import time
from pathlib import Path

import numpy as np

import modalscope as ms

here = Path(__file__).parent
test, band = here / "beam_hammer" / "beam_hammer.uff", (100.0, 4500.0)
report = Path("demo-report.html")

started = time.perf_counter()
data = ms.read(test)
print(f"{test.name}: {data.values.shape[1]} accelerometers x {data.values.shape[2]} hammer points, {data.lines} lines")

result = ms.analyze(data, band=band)
modes = result.modes

with (here / "beam_hammer" / "published_modes.csv").open() as file:
    published = [(float(row["frequency_hz"]), float(row["damping_ratio"])) for row in csv.DictReader(file)]


print(f"\n{modes.table()}\n\npublished")
for f, zeta in published:
    k = int(np.argmin(abs(modes.frequencies - f)))
    df, dz = modes.frequencies[k] / f - 1, modes.damping_ratios[k] / zeta - 1
    print(f"  {f:7.1f} Hz  {100 * zeta:.2f} %   mode {k + 1}: frequency {100 * df:+.2f} %, damping {100 * dz:+.0f} %")

ms.report(result, report, source=str(test), title="Modes of a measured beam")
print(f"\nthe report, one file with its pictures: {report.resolve()}")
print(f"{time.perf_counter() - started:.1f} s from file to report")
