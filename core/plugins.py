"""All that a plugin builds on: base classes and declarations, by one import."""

from __future__ import annotations

from .algorithms.settings import AlgorithmSettings, Crossover, Mutation
from .declarations import Kind, Output, Parameter, Value, Variable
from .models.costs import CostCurve
from .models.effects.effect import Action, Effect, EffectParameter, Readings, Target
from .models.effects.shapes import OneColumn, Weight
from .models.inputs import Distribution
from .models.measurable import Changeable, Column, MeasurableModel, Role
from .page_section import PageSection
from .problems.settings import Settings
from .problems.tolerance_problem import ToleranceProblem
from .records import RunResult
from .workflows.choice.rule import ChoiceRule, Points
from .workflows.study.records import Design, Factor

__all__ = [
    "Action",
    "AlgorithmSettings",
    "Changeable",
    "ChoiceRule",
    "Column",
    "CostCurve",
    "Crossover",
    "Design",
    "Distribution",
    "Effect",
    "EffectParameter",
    "Factor",
    "Kind",
    "MeasurableModel",
    "Mutation",
    "OneColumn",
    "Output",
    "PageSection",
    "Parameter",
    "Points",
    "Readings",
    "Role",
    "RunResult",
    "Settings",
    "Target",
    "ToleranceProblem",
    "Value",
    "Variable",
    "Weight",
]
