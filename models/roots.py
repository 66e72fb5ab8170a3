"""Roots of many functions of one variable at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def bracketed_roots(function: Callable[..., Any], ends: tuple[Any, Any], *args: Any) -> Any:
    """Roots `x`, of any shape, of function(x, *args) between `ends`, and their last `bracket`.

    Reference: Chandrupatla (1997), Advances in Engineering Software 28(3), 145-149.
    """
    from scipy.optimize.elementwise import find_root  # which scipy does not import by itself

    return find_root(function, ends, args=args)
