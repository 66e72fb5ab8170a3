"""All that a plugin builds on: base classes and declarations, by a single import."""

from __future__ import annotations

from .algorithms.settings import AlgorithmSettings, Crossover, Mutation
from .commands.run.choice import ChoiceRule, Points
from .commands.study.plan import Design, Factor
from .models.costs import CostCurve
from .models.effects.effect import Action, Effect, EffectParameter, Measurements, Target
from .models.effects.shapes import OneColumn, Weight
from .models.inputs import Distribution
from .models.measurable import Changeable, Column, MeasurableModel, Role
from .problems.declaration import Declaration
from .problems.interfaces import (
    Accuracy,
    Checks,
    Comparison,
    Differentiable,
    Documented,
    Drawing,
    Page,
    Provable,
    Stored,
    WithEffects,
    Written,
)
from .problems.settings import Settings
from .problems.tolerance_problem import ToleranceProblem
from .records import PageSection, RunResult
from .section import Kind, Output, Parameter, Value, Variable

__all__ = [
    "Accuracy",
    "Action",
    "AlgorithmSettings",
    "Changeable",
    "Checks",
    "ChoiceRule",
    "Column",
    "Comparison",
    "CostCurve",
    "Crossover",
    "Declaration",
    "Design",
    "Differentiable",
    "Distribution",
    "Documented",
    "Drawing",
    "Effect",
    "EffectParameter",
    "Factor",
    "Kind",
    "MeasurableModel",
    "Measurements",
    "Mutation",
    "OneColumn",
    "Output",
    "Page",
    "PageSection",
    "Parameter",
    "Points",
    "Provable",
    "Role",
    "RunResult",
    "Settings",
    "Stored",
    "Target",
    "ToleranceProblem",
    "Value",
    "Variable",
    "Weight",
    "WithEffects",
    "Written",
]
