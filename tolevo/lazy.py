"""Packages whose names are imported when they are first used."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple


class Renamed(NamedTuple):
    """A public name that was replaced: the new name, and the version that removes the old name."""

    name: str
    until: str


def lazily(
    package: str, places: Mapping[str, str], renamed: Mapping[str, Renamed] = MappingProxyType({})
) -> Callable[[str], Any]:
    """`__getattr__` of a package: a name is taken from the module that `places` give, relative to
    the package; a name whose place is empty is a module itself. A name in `renamed` warns
    (DeprecationWarning) and gives what the new name gives.
    """

    def get(name: str) -> Any:
        if name in renamed:
            new = renamed[name]
            text = f"{package}.{name} is now {package}.{new.name}; the old name is removed in version {new.until}"
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return get(new.name)
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not (place := places[name]):
            return import_module(f".{name}", package)
        return getattr(import_module(place, package), name)

    return get
