"""`[free]` of a gap analysis: what may be recalibrated, and by how much."""

from __future__ import annotations

from collections.abc import Mapping

from .. import registry
from ..errors import nearest
from ..section import POSITIVE, Section, flat
from ..units import split_unit
from .configuration import Configuration
from .plugins import ModelClass


def read_free(top: Section, configuration: Configuration | None) -> dict[str, float]:
    """Tolerance by parameter; without the table the model's own list of free parameters."""
    section = top.section("free")
    kind = registry.load("models", configuration.model_name) if configuration else None
    if "free" not in top:
        if configuration is None or kind is None:
            return {}
        return dict(kind.free_of(configuration.settings.parameters))
    stated = top.take("free")
    known = _freeable(kind) if kind is not None else {}
    tolerances: dict[str, float | None] = {}
    for key, value in flat(stated).items() if isinstance(stated, dict) else ():
        if key not in known:
            why = "is not a parameter of the model" if kind else 'model = "table" has no parameters'
            section.fault(key, f"{why}{nearest(key, known)}")
            continue
        tolerances[key] = section.as_number(key, value, known[key], POSITIVE)
    return {key: value for key, value in tolerances.items() if value is not None}


def _freeable(kind: ModelClass) -> dict[str, str]:
    """Unit by name of every parameter that is a number, those of tables by dotted name."""
    units: dict[str, str] = {}
    for parameter in kind.parameters:
        if isinstance(parameter.default, Mapping):
            units |= {f"{parameter.name}.{name}": split_unit(name)[1] for name in parameter.choices}
        elif isinstance(parameter.default, float):
            units[parameter.name] = parameter.unit
    return units
