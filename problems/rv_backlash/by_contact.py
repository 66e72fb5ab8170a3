"""The exact contact's verdict on allocations of the closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ..settings import Settings

if TYPE_CHECKING:
    from ..rv_reducer import RvReducer
    from .problem import RvBacklash


def contact_problem(problem: RvBacklash) -> RvReducer:
    """The problem of the same reducer on its exact contact: parameters, mid-limits and effects carried over.

    Errors between discs, which the closed form does not know, are at their defaults.
    """
    from ..rv_reducer import RvReducer  # it takes the costs of this problem

    known = {parameter.name for parameter in RvReducer.declaration.parameters}
    given = {n: v for n, v in problem.settings.parameters.items() if n in known}
    inputs = {n: setting for n, setting in problem.given.variables.items() if setting.distribution or setting.mid}
    return RvReducer(
        Settings(
            parameters=given,
            variables=inputs,
            propagation=problem.settings.propagation,
            seed=problem.settings.seed,
            effects=problem.settings.effects,
        )
    )


def verdicts(problem: RvBacklash, designs: Array) -> tuple[str, ...]:
    """The verdict on each full design (n, all variables) of the closed form."""
    contact = contact_problem(problem)
    values = [contact.fixed | dict(zip(problem.names, design.tolist(), strict=True)) for design in designs]
    rows = [np.array([design.get(name) for name in contact.names], dtype=float) for design in values]
    coverage = 100.0 * problem.settings.propagation.coverage
    evaluations = [contact.evaluation(row, searching=False) for row in rows]
    return tuple(
        f"by contact this allocation keeps {problem.limit:g} arcmin in {evaluation.value('yield_percent'):.1f} % of "
        f"the units at all {contact.count('positions')} positions of a turn; {coverage:.4g} % of them stay below "
        f"{evaluation.value('backlash_max_arcmin'):.2f} arcmin, and "
        f"{100.0 * evaluation.value('interference_probability'):.2g} % interfere"
        for evaluation in evaluations
    )
