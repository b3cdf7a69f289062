"""
Follow modes through months and tell a change
=============================================

Modes of every record are joined into tracks, temperature is taken out, and a chart tells a change. Simulated: four months of
records, one every three hours, of two modes that fall with temperature; from day 100 on the first lies 0.2 % lower.
"""

import numpy as np

import modalscope as ms

hours, draw = np.arange(0, 120 * 24, 3), np.random.default_rng(0)
air = 8 + 6 * np.sin(hours / 300) + 4 * np.sin(2 * np.pi * hours / 24)
f = np.outer(1 - 3e-4 * air, [1.25, 2.1]) * (1 + 5e-4 * draw.standard_normal((hours.size, 2)))
f[hours >= 100 * 24, 0] *= 0.998
history = ms.monitoring.History(
    times=np.datetime64("2026-01-01") + hours * np.timedelta64(1, "h"),
    record=np.repeat(np.arange(hours.size), 2),
    frequencies=f.ravel(),
    covariates={"temperature": air + 0.2 * draw.standard_normal(hours.size)},
)
tracks = ms.monitoring.track(history)
found = ms.monitoring.alarms(tracks, reference=("2026-01-01", "2026-03-01"), false_per_year=1)
print(found.explained.table())
print(found.table())
ms.plot.control_chart(found)
