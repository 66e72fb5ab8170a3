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
    sentences = [drawing.assumed] if drawing.assumed else []
    sentences.append(
        f"Model {drawing.model}; geometry from {drawing.geometry_from}; allocation from {drawing.allocation_from}."
    )
    if drawing.effects:
        sentences.append(f"Effects in the simulated units: {', '.join(drawing.effects)}.")
    geometry = [
        {
            "geometry": parameter.name,
            "value": _shown(parameter.value),
            "unit": parameter.unit,
            "meaning": parameter.meaning,
        }
        for parameter in drawing.geometry
    ]
    zones = [
        {
            "variable": zone.variable,
            "value": zone.value,
            "unit": zone.unit,
            "means": zone.kind,
            "zone from": zone.low,
            "to": zone.high,
            "distribution": zone.distribution,
        }
        for zone in drawing.zones
    ]
    parts = [bullets(sentences), table(pd.DataFrame(geometry))]
    return "\n".join([*parts, table(pd.DataFrame(zones)) if zones else ""])


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, int | float) else escape(str(value))
