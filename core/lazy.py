"""Packages whose names are imported when they are first used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazily(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """`__getattr__` of a package: each name is found in the module that `places` give, relative to
    the package; one whose place is empty is a module itself.
    """

    def get(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not (place := places[name]):
            return import_module(f".{name}", package)
        return getattr(import_module(place, package), name)

    return get
