"""How a value is recomputed: by a calculation, a model, a problem, a formula or a derivative."""

from __future__ import annotations

from .by_calculation import ByCalculation
from .by_formula import ByFormula, Constant
from .by_model import STATISTICS, ByModel, Statistic
from .by_problem import ByProblem
from .derivative import Derivative
from .recipe import Recipe, Recomputed

__all__ = [
    "STATISTICS",
    "ByCalculation",
    "ByFormula",
    "ByModel",
    "ByProblem",
    "Constant",
    "Derivative",
    "Recipe",
    "Recomputed",
    "Statistic",
]
