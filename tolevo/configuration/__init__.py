"""Configurations: TOML in, everything a command needs out, every fault at once."""

from __future__ import annotations

from .configuration import Configuration
from .reader import read

__all__ = ["Configuration", "read"]
