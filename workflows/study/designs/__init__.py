"""Designs of experiments, one kind per file; `[design] kind` names one of `DESIGNS`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ..records import Design
from .factorial import Factorial
from .latin_hypercube import LatinHypercube
from .morris import Morris
from .one_at_a_time import OneAtATime
from .sobol import Sobol
from .table import Table

DESIGNS: Mapping[str, type[Design]] = MappingProxyType(
    {one.kind: one for one in (OneAtATime, Factorial, LatinHypercube, Morris, Sobol, Table)}
)
"""The kinds of designs by name."""

__all__ = ["DESIGNS", "Factorial", "LatinHypercube", "Morris", "OneAtATime", "Sobol", "Table"]
