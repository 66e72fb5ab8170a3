"""From allocations of a form to designs of its problem."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...problems.forms import Form
from ...problems.interfaces import Provable
from ...problems.tolerance_problem import ToleranceProblem
from .combination import Optimum


def search_vectors(problem: ToleranceProblem, form: Form, optimum: Optimum) -> Array:
    """Search vectors (k, free variables) of the allocations that exist, within the bounds."""
    real = np.isfinite(optimum.cost)
    columns = {name: np.full(int(real.sum()), value) for name, value in form.settled.items()}
    for at, feature in enumerate(form.features):
        if feature.variable:
            columns[feature.variable] = optimum.t[real, at]
        if feature.choice:
            choices = np.array([way.choice for way in feature.ways])
            columns[feature.choice] = choices[optimum.chosen[real, at]]
    columns = Provable.of(problem).form_columns(columns)
    x = np.stack([columns[variable.name] for variable in problem.free], axis=1)
    return np.asarray(np.clip(x, problem.xl, problem.xu))


def search_vector(problem: ToleranceProblem, form: Form, ways: tuple[int, ...], t: Array) -> Array:
    """The search vector (1, free variables) of one allocation: ways and tolerances (features,)."""
    nothing = np.zeros(1)
    optimum = Optimum(np.array([ways]), t[None, :], nothing, nothing, nothing[:, None])
    return search_vectors(problem, form, optimum)
