"""Names in a configuration that stand for registered models, problems, algorithms, effects."""

from __future__ import annotations

from typing import Any

from .. import registry
from ..errors import Fault, InputError
from ..section import Section


def load_named(section: Section, key: str, group: str, default: str = "") -> Any:
    """The class that `key` names in the registry `group`; None and a fault where there is none."""
    name = section.text(key)
    if name is None:
        if key in section or not default:
            return None
        name = default
    try:
        return registry.load(group, name)
    except InputError as error:
        for fault in error.faults:
            section.fault(key, fault.message)
    return None


def effect_faults(effects: Any) -> list[Fault]:
    """Faults of `[[effect]]`: no effect is installed in this version."""
    if effects is None:
        return []
    if not isinstance(effects, list) or not all(isinstance(one, dict) for one in effects):
        return [Fault("effect", "must be a list of tables: write [[effect]]")]
    return [_effect_fault(f"effect[{at}]", one) for at, one in enumerate(effects)]


def _effect_fault(place: str, effect: dict[str, Any]) -> Fault:
    name = effect.get("name")
    if not isinstance(name, str):
        return Fault(f"{place}.name", "must name an effect (a string)")
    return Fault(f"{place}.name", f'"{name}" is not an installed effect; none is in this version')
