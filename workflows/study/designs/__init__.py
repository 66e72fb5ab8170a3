"""Designs of experiments, one kind per file; `[design] kind` names one of `DESIGNS`."""

from __future__ import annotations

from ....registry import Kinds
from ..records import Design
from .factorial import Factorial
from .latin_hypercube import LatinHypercube
from .morris import Morris
from .one_at_a_time import OneAtATime
from .sobol import Sobol
from .table import Table

DESIGNS: Kinds[Design] = Kinds("designs")
"""The kinds of designs by name: entry points of `tolevo.designs`."""

__all__ = ["DESIGNS", "Factorial", "LatinHypercube", "Morris", "OneAtATime", "Sobol", "Table"]
