"""The picture of the README: the measured beam's stabilization diagram, 1200 x 800."""

from pathlib import Path

from matplotlib.figure import Figure

import modalscope as ms

here = Path(__file__).parent
diagram = ms.stabilize(ms.read(here / "beam_hammer" / "beam_hammer.uff"), band=(100, 4500))
figure = Figure(figsize=(12, 8), dpi=100, layout="constrained")
ms.plot.stabilization(diagram, ms.select(diagram), ax=figure.add_subplot())
figure.savefig(here.parent / "docs" / "stabilization.png")
