"""The drawing that the units are simulated by: the first section of the page of a batch."""

from __future__ import annotations

from ...gap_drawing_records import Drawing
from ..document import bullets
from ..tables import listed, table


def drawing_section(drawing: Drawing | None) -> str:
    """Source, geometry and zones; empty where the units follow no drawing."""
    if drawing is None:
        return ""
    sentences = [drawing.assumed] if drawing.assumed else []
    sentences.append(
        f"Model {drawing.model}; geometry from {drawing.geometry_from}; allocation from {drawing.allocation_from}."
    )
    if drawing.effects:
        sentences.append(f"Effects in the simulated units: {', '.join(drawing.effects)}.")
    geometry = listed(drawing.geometry, "name: geometry, value, unit, meaning")
    geometry["value"] = [f"{v:g}" if isinstance(v, int | float) else str(v) for v in geometry["value"]]
    zones = listed(drawing.zones, "variable, value, unit, kind: means, low: zone from, high: to, distribution")
    return "\n".join([bullets(sentences), table(geometry), table(zones) if len(zones) else ""])
