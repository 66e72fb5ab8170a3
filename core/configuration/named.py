"""A name in a configuration that represents an object."""

from __future__ import annotations

from typing import Any


class Named(str):
    """The name of an object, as configurations write it, and the object itself."""

    original: Any
    __slots__ = ("original",)

    @classmethod
    def of(cls, original: Any) -> Named:
        """An object, named by the path of its class."""
        kind = original if isinstance(original, type) else type(original)
        named = cls(f"{kind.__module__}:{kind.__qualname__}")
        named.original = original
        return named

    def __deepcopy__(self, memo: dict[int, Any]) -> Named:
        return self
