"""What the units were simulated as: the first section of the page of a batch."""

from __future__ import annotations

from html import escape

import pandas as pd

from ...gap_drawing_records import Drawing
from ..document import bullets
from ..tables import table


def drawing_section(drawing: Drawing | None) -> str:
    """Source, geometry and zones; empty where units are made to no drawing."""
    if drawing is None:
        return ""
    said = [drawing.assumed] if drawing.assumed else []
    said.append(
        f"Model {drawing.model}; geometry from {drawing.geometry_from}; allocation from "
        f"{drawing.allocation_from}."
    )
    if drawing.effects:
        said.append(f"Effects in the simulated units: {', '.join(drawing.effects)}.")
    geometry = [
        {"geometry": one.name, "value": _shown(one.value), "unit": one.unit, "meaning": one.meaning}
        for one in drawing.geometry
    ]
    zones = [
        {
            "variable": one.variable,
            "value": one.value,
            "unit": one.unit,
            "means": one.kind,
            "zone from": one.low,
            "to": one.high,
            "distribution": one.distribution,
        }
        for one in drawing.zones
    ]
    parts = [bullets(said), table(pd.DataFrame(geometry))]
    return "\n".join([*parts, table(pd.DataFrame(zones)) if zones else ""])


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, int | float) else escape(str(value))
