"""List the pictures of a result by name, as archives, files beside reports, documents and slides have them."""

from __future__ import annotations

from collections.abc import Sequence

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.interfaces.plot.diagrams import stabilization_picture
from modalscope.interfaces.plot.matrices import mac_picture
from modalscope.interfaces.plot.picture import Picture
from modalscope.interfaces.plot.responses import response_picture
from modalscope.interfaces.plot.shapes import shape_picture
from modalscope.interfaces.plot.web.modes import over_points


def pictures_of(
    modes: ModalModel, diagrams: Sequence[StabilizationDiagram], most: int | None = None
) -> dict[str, Picture]:
    """Return the pictures of a result by name: diagram of all bands, shapes, AutoMAC, strongest response.

    `most`: shapes at most. Of one output there are neither shapes nor MAC.
    """
    pictures = {"diagram": stabilization_picture(diagrams, modes)}
    points = over_points(modes, diagrams[0].response)
    if len(points.output_dofs) > 1:
        pictures |= {f"mode{k + 1}": shape_picture(points, k) for k in range(len(modes))[:most]}
        pictures |= {"mac": mac_picture(points)} if len(modes) > 1 else {}
    if modes.participation is not None and len(modes):
        pictures["response"] = response_picture(diagrams[0].response, modes)
    return pictures
