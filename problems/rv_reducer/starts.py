"""Designs of `rv_reducer` that a search by gradients begins from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.rv_reducer.geometry import RvGeometry
from ..settings import Bound
from .declared import DISC_TO_DISC

if TYPE_CHECKING:
    from .problem import RvReducer

FACTORS = (0.0, 0.7, 1.0, 1.4)
"""Zones over those of the document; 0: the tightest of the search ranges."""
HALVINGS = 12
"""Steps of the bisection for the equidistance modification."""
USUAL = 0.02
"""Probability of interference that is the target where no limit is set."""


def nominal_of(problem: RvReducer) -> dict[str, float]:
    """The document's value of every variable; errors between discs as the problem fixes them."""
    values = {v.name: float(v.document or 0.0) for v in problem.variables}
    return values | {name: problem.fixed[name] for name in DISC_TO_DISC if name in problem.fixed}


def starts_of(problem: RvReducer) -> Array:
    """The tightest zones, and the document's, tighter and wider: full designs (k, all variables).

    Each is opened until the limit on interference is kept.
    """
    names, nominal, rows = problem.names, nominal_of(problem), []
    zones = [names.index(v.name) for v in problem.variables if v.name.endswith("_um")]
    for factor in FACTORS:
        row = np.array([nominal[name] for name in names])
        row[names.index("dr_p_mm")] *= _deeper(problem)
        row[zones] *= factor
        rows.append(_opened(problem, _inside(problem, row)))
    return np.array(rows)


def _deeper(problem: RvReducer) -> float:
    """Ratio of shift modifications that leave the same radial gap, to the RV-40E's."""
    return (1.0 - RvGeometry().flank) / (1.0 - problem.model.geometry.nominal.flank)


def _inside(problem: RvReducer, row: Array) -> Array:
    """A full design within the search ranges, at the fixed values."""
    free = [problem.names.index(v.name) for v in problem.free]
    return np.asarray(problem.complete(np.clip(row[free], problem.xl, problem.xu)[None, :])[0])


def _opened(problem: RvReducer, row: Array) -> Array:
    """The design with the equidistance modification at which interference is in its middle.

    The middle is half of the limit on its probability, `USUAL` where there is none.
    """
    at = problem.names.index("dr_rp_mm")
    bound = problem.settings.limits.get("interference_probability", Bound())
    wanted = 0.5 * bound.high if bound.high < 1.0 else USUAL
    low, high = problem.interval("dr_rp_mm")
    for _ in range(HALVINGS if low < high else 0):
        row[at] = 0.5 * (low + high)
        interferes = problem.evaluation(row, searching=True).value("interference_probability")
        low, high = (row[at], high) if interferes > wanted else (low, row[at])
    return row
