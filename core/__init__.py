"""Tolerance allocation for mechanisms; everything here is imported when it is first used."""

from __future__ import annotations

from typing import Any

_FROM_API = ("evaluate", "read", "run", "simulate")
_FROM_TABLES = ("read_aqdef", "read_table")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("tolevo")
    if name in _FROM_API:
        from . import api

        return getattr(api, name)
    if name in _FROM_TABLES:
        from . import tables

        return getattr(tables, name)
    if name == "ConfigurationError":
        from .errors import ConfigurationError

        return ConfigurationError
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
