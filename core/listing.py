"""`tolevo list`: what is installed, as text or as JSON."""

from __future__ import annotations

import json

from . import registry
from .models.manipulator.sources import SOURCES


def listed(as_json: bool = False) -> str:
    """Models, problems, algorithms, effects, calculations, and the elementary errors."""
    groups = registry.listing() | {"elementary_errors": _elementary_errors()}
    if as_json:
        return json.dumps(groups, indent=2)
    lines = []
    for group, entries in groups.items():
        lines.append(f"{group}:" if entries else f"{group}: none")
        for entry in entries:
            family = f"{entry['family']}: " if "family" in entry else ""
            text = f"{family}{entry['description']} [{entry['origin']}]"
            lines.append(f"  {entry['name']:<16} {text}")
    return "\n".join(lines)


def _elementary_errors() -> list[dict[str, str]]:
    """The names that `[parameters.elementary_errors]` takes, in the form of `registry.listing`."""
    return [{"name": error.name, "description": error.meaning, "origin": "manipulator"} for error in SOURCES]
