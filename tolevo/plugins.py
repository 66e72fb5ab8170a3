"""All that a plugin builds on: base classes and declarations, by a single import."""

from __future__ import annotations

import warnings
from functools import cache

from .algorithms.settings import AlgorithmSettings, Crossover, Mutation
from .commands.run.choice import ChoiceRule, Points
from .commands.study.plan import Design, Factor
from .models.costs import CostCurve
from .models.effects.effect import Action, Effect, EffectParameter, Measurements, Target
from .models.effects.shapes import OneColumn, Weight
from .models.effects.unresolved import plays
from .models.inputs import Distribution
from .models.measurable import Changeable, Column, MeasurableModel, Role
from .problems.declaration import Declaration
from .problems.settings import Settings
from .problems.tolerance_problem import ToleranceProblem
from .records import PageSection, RunResult
from .section import Kind, Output, Parameter, Value, Variable

__all__ = [
    "Action",
    "AlgorithmSettings",
    "Changeable",
    "ChoiceRule",
    "Column",
    "CostCurve",
    "Crossover",
    "Declaration",
    "Design",
    "Distribution",
    "Effect",
    "EffectParameter",
    "Factor",
    "Kind",
    "MeasurableModel",
    "Measurements",
    "Mutation",
    "OneColumn",
    "Output",
    "PageSection",
    "Parameter",
    "Points",
    "Role",
    "RunResult",
    "Settings",
    "Target",
    "ToleranceProblem",
    "Value",
    "Variable",
    "Weight",
    "plays",
]

_FORMER = frozenset(
    {
        "Accuracy",
        "Checks",
        "Comparison",
        "Differentiable",
        "Documented",
        "Drawing",
        "Page",
        "Provable",
        "Stored",
        "WithEffects",
        "Written",
    }
)
"""Classes that a problem had to inherit until 0.2; what they declared are methods of `ToleranceProblem`."""


@cache
def _former(name: str) -> type:
    return type(name, (), {"__doc__": "Nothing: its members are methods of `ToleranceProblem`."})


def __getattr__(name: str) -> type:
    if name not in _FORMER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    text = f"tolevo.plugins.{name} is not needed any more: ToleranceProblem has its members, with the same defaults"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return _former(name)
