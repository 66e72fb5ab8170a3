"""Names as figures and sentences show them."""

from __future__ import annotations

from typing import Any


def short(key: str) -> str:
    """A key without its table: "crossover probability"."""
    return key.removeprefix("algorithm.").replace(".", " ").replace("_", " ")


def level(value: Any) -> str:
    """A level of a key."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def wide(low: float, high: float) -> bool:
    """Whether values span so much that a logarithmic axis shows them better."""
    return low > 0.0 and high / low > 30.0
