"""Names in a configuration that stand for registered models, problems, algorithms, effects."""

from __future__ import annotations

from typing import Any

from .. import registry
from ..errors import InputError
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
