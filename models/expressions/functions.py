"""The functions that a formula may call: value, slopes, and where they are not defined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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


def _within_one(x: Array) -> str:
    return "" if np.all(np.abs(x) <= 1.0) else f"is defined on [-1, 1], its argument is {span(x)}"


def _not_negative(x: Array) -> str:
    return "" if np.all(x >= 0.0) else f"needs a value of at least 0, its argument is {span(x)}"


def _positive(x: Array) -> str:
    return "" if np.all(x > 0.0) else f"needs a value above 0, its argument is {span(x)}"


def _no_pole(x: Array) -> str:
    """A pole of the tangent lies between two samples in different periods."""
    period = np.floor(np.asarray(x) / np.pi + 0.5)
    return "" if np.all(period == np.ravel(period)[0]) else f"has a pole within {span(x)} rad"


def _off_the_cut(y: Array, x: Array) -> str:
    """atan2 jumps by 2 pi where y changes its sign at negative x."""
    beside_the_cut = np.broadcast_arrays(y, x)[0][np.broadcast_arrays(x, y)[0] <= 0.0]
    jumps = beside_the_cut.size > 0 and crosses_zero(beside_the_cut)
    return "jumps by 2 pi: its first argument crosses 0 while the second is negative" * jumps


def _chosen(pick: Callable[..., Array]) -> Callable[..., tuple[Array, ...]]:
    """Slope 1 for the first argument that the extremum takes, 0 for the others."""

    def slopes(*x: Array) -> tuple[Array, ...]:
        extremum_at = pick(np.stack(np.broadcast_arrays(*x)), axis=0)
        return tuple(np.where(extremum_at == at, 1.0, 0.0) for at in range(len(x)))

    return slopes


def _extremum(pick: Callable[..., Array]) -> Callable[..., Array]:
    return lambda *x: pick(np.stack(np.broadcast_arrays(*x)), axis=0)


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
        "min": Function(_extremum(np.min), _chosen(np.argmin), least=2, most=16),
        "max": Function(_extremum(np.max), _chosen(np.argmax), least=2, most=16),
    }
)
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": float(np.pi)})
