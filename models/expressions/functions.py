"""The functions that a formula may call: value, slopes, and where they are not defined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from ...arrays import Array


def _everywhere(*_: Array) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class Function:
    """A function of `least` to `most` arguments.

    `value` and `slopes` (one partial derivative per argument) are vectorised. `trouble` returns
    why the function is not defined or jumps somewhere on a connected set that the arguments are
    sampled from; empty where it is defined and continuous.
    """

    value: Callable[..., Array]
    slopes: Callable[..., tuple[Array, ...]]
    trouble: Callable[..., str] = _everywhere
    least: int = 1
    most: int = 1


def crosses_zero(x: Array) -> bool:
    """Whether values of a continuous function show that it is zero somewhere between them."""
    return bool(np.min(x) <= 0.0 <= np.max(x))


def span(x: Array) -> str:
    """The values as text: one number, or from the least to the largest."""
    low, high = float(np.min(x)), float(np.max(x))
    return f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"


def _domain(contains: Callable[[Array], Any], requirement: str) -> Callable[[Array], str]:
    return lambda x: "" if np.all(contains(x)) else f"{requirement}, its argument is {span(x)}"


_within_one = _domain(lambda x: np.abs(x) <= 1.0, "is defined on [-1, 1]")
_not_negative = _domain(lambda x: x >= 0.0, "needs a value of at least 0")
_positive = _domain(lambda x: x > 0.0, "needs a value above 0")


def _no_pole(x: Array) -> str:
    """A pole of the tangent lies between two samples in different periods."""
    period = np.floor(np.asarray(x) / np.pi + 0.5)
    return "" if np.all(period == np.ravel(period)[0]) else f"has a pole within {span(x)} rad"


def _off_the_cut(y: Array, x: Array) -> str:
    """atan2 jumps by 2 pi where y changes its sign at negative x."""
    y, x = np.broadcast_arrays(y, x)
    y_left = y[x <= 0.0]
    jumps = y_left.size > 0 and crosses_zero(y_left)
    return "jumps by 2 pi: its first argument crosses 0 while the second is negative" if jumps else ""


def _over_arguments(reduce: Callable[..., Array]) -> Callable[..., Array]:
    return lambda *x: reduce(np.stack(np.broadcast_arrays(*x)), axis=0)


def _extremum_slopes(place: Callable[..., Array]) -> Callable[..., tuple[Array, ...]]:
    """Slope 1 for the first argument that is the extremum, 0 for the others."""
    place_of = _over_arguments(place)
    return lambda *x: tuple(np.where(place_of(*x) == at, 1.0, 0.0) for at in range(len(x)))


FUNCTIONS: Mapping[str, Function] = MappingProxyType(
    {
        "sin": Function(np.sin, lambda x: (np.cos(x),)),
        "cos": Function(np.cos, lambda x: (-np.sin(x),)),
        "tan": Function(np.tan, lambda x: (1.0 / np.cos(x) ** 2,), _no_pole),
        "asin": Function(np.arcsin, lambda x: (1.0 / np.sqrt(1.0 - x * x),), _within_one),
        "acos": Function(np.arccos, lambda x: (-1.0 / np.sqrt(1.0 - x * x),), _within_one),
        "atan": Function(np.arctan, lambda x: (1.0 / (1.0 + x * x),)),
        "atan2": Function(
            np.arctan2, lambda y, x: (x / (x * x + y * y), -y / (x * x + y * y)), _off_the_cut, least=2, most=2
        ),
        "sqrt": Function(np.sqrt, lambda x: (0.5 / np.sqrt(x),), _not_negative),
        "exp": Function(np.exp, lambda x: (np.exp(x),)),
        "log": Function(np.log, lambda x: (1.0 / x,), _positive),
        "abs": Function(np.abs, lambda x: (np.sign(x),)),
        "min": Function(_over_arguments(np.min), _extremum_slopes(np.argmin), least=2, most=16),
        "max": Function(_over_arguments(np.max), _extremum_slopes(np.argmax), least=2, most=16),
    }
)
KINKED = ("abs", "min", "max")
"""Functions whose slopes jump somewhere."""
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": float(np.pi)})
