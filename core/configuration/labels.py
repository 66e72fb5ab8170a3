"""Reads `name`, `description` and `drawing` of the mechanism that a configuration is about."""

from __future__ import annotations

from dataclasses import asdict

from ..problems.settings import Labels
from ..section import Section


def read_labels(top: Section) -> Labels:
    """What readers know the mechanism by; empty where the configuration does not say it."""
    keys = ("name", "description", "drawing")
    return Labels(*(top.text(key) or "" for key in keys))


def resolved_labels(labels: Labels) -> dict[str, str]:
    """The keys that are stated."""
    return {key: value for key, value in asdict(labels).items() if value}
