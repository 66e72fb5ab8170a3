"""Every table that describes a problem: reading them again gives the same problem."""

from __future__ import annotations

from typing import Any

from ..problems.tolerance_problem import ToleranceProblem
from .effects import resolved_effects
from .model_columns import resolved_columns
from .money import resolved_money
from .resolved import resolved_problem
from .sense import resolved_sense
from .zero import resolved_zero


def complete_tables(problem: ToleranceProblem, name: str, model: str) -> dict[str, Any]:
    """The tables of a problem that configurations know as `name`, and of its model (may be "")."""
    settings = problem.settings
    return {
        "problem": name,
        **({"model": model} if model else {}),
        **settings.labels.stated(),
        "seed": settings.seed,
        **resolved_money(settings.money, resolved_problem(problem)),
        **resolved_columns(settings.columns),
        **resolved_zero(settings.zero),
        **resolved_sense(settings.sense),
        **resolved_effects(settings.effects),
    }
