"""The database of a study: one row per run as soon as it ends."""

from __future__ import annotations

from .database import DATABASE, Database
from .opening import opened

__all__ = ["DATABASE", "Database", "opened"]
