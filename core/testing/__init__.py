"""Contract tests that plugins inherit, ours first.

class TestMyProblem(ProblemContract):
    problem_type = MyProblem
"""

from __future__ import annotations

from .algorithm import AlgorithmContract
from .curve import CurveContract
from .design import DesignContract
from .distribution import DistributionContract
from .effect import COLUMNS, EffectContract
from .model import ModelContract
from .problem import ProblemContract
from .promising import PromisingContract
from .rule import RuleContract
from .section import PageContract

__all__ = [
    "COLUMNS",
    "AlgorithmContract",
    "CurveContract",
    "DesignContract",
    "DistributionContract",
    "EffectContract",
    "ModelContract",
    "PageContract",
    "ProblemContract",
    "PromisingContract",
    "RuleContract",
]
