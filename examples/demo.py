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


def near(frequency: float) -> tuple[float, float] | None:
    """The published mode within 1 % that no other mode is nearer to, if there is one."""
    within = [p for p in published if abs(p[0] - frequency) < 0.01 * frequency]
    return next((p for p in within if abs(p[0] - frequency) <= min(abs(modes.frequencies - p[0]))), None)


ends = modes.interval(0.95)
print("\n        modalscope, 95 % intervals                       published")
print(" mode   f [Hz]            zeta [%]                  f [Hz]    zeta [%]   why")
for k, (f, zeta, why) in enumerate(zip(modes.frequencies, modes.damping_ratios, modes.reasons, strict=True)):
    match = near(f)
    beside = f"{match[0]:8.1f}  {100 * match[1]:8.2f}" if match else "       -         -"
    half_width, (low, high) = float(ends["frequency"][k, 1] - f), 100 * ends["damping_ratio"][k]
    # a mode that the data leave open has a value and no interval
    of_f, of_zeta = (
        (f"±{half_width:5.2f}", f"({low:.3f} to {high:.3f})") if np.isfinite(half_width) else ("  open", "(open)")
    )
    print(f"{k + 1:4d}  {f:9.2f} {of_f}  {100 * zeta:7.3f} {of_zeta:16}  {beside}     {why['text']}")

ms.report(result, report, source=str(test), title="Modes of a measured beam")
print(f"\nthe report, one file with its pictures: {report.resolve()}")
print(f"{time.perf_counter() - started:.1f} s from file to report")
