"""Reads `name`, `description` and `drawing` of the mechanism that a configuration is about."""

from __future__ import annotations

from ..problems.settings import Labels
from ..section import Section

KEYS = ("name", "description", "drawing")


def read_labels(top: Section) -> Labels:
    """Labels of the mechanism; empty where the configuration states none."""
    return Labels(*(top.text(key) or "" for key in KEYS))
