"""States of searches that consist of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

State = dict[str, NDArray[Any]]
SavedState = Mapping[str, NDArray[Any]]


def part(state: SavedState, prefix: str) -> State:
    """The entries of a state whose names have a prefix, named without it."""
    return {key.removeprefix(prefix): value for key, value in state.items() if key.startswith(prefix)}


def joined(**parts: State) -> State:
    """The entries of several states in one: the `key` of the state `name` is named "name.key"."""
    return {f"{name}.{key}": value for name, state in parts.items() for key, value in state.items()}
