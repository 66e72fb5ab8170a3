"""A batch of RV reducers: the backlash of units drawn from an allocation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...declarations import Output, Value
from ...units import ARCMIN
from ..inputs import Distribution
from ..measurable import Column, MeasurableModel
from ..propagation.sums import Term
from . import declared

Array = NDArray[np.float64]


class RvBatch(MeasurableModel):
    """Backlash of RV reducer units, one per row, drawn from their tolerances.

    `designs` gives tolerances and modification by variable name (the document's allocation where
    not named), `inputs` distributions by variable name. The base model knows no temperature and no
    lots: uniform heating of an all-steel unit changes nothing.
    """

    columns = (
        Column("unit", "", "name of the unit", label=True),
        Column("temperature_C", "C", "temperature of the unit", needed=False),
        Column("lot", "", "lot of its parts", needed=False, label=True),
    )
    outputs = (Output("backlash_arcmin", "arcmin", "phi_1 + max(0, phi_2) + phi_3 of the unit"),)
    parameters = declared.PARAMETERS
    variables = declared.VARIABLES
    free = tuple(f"{name}_mid_um" for name in declared.ERRORS)

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        stems = {name.removesuffix("_um"): d for name, d in (inputs or {}).items()}
        self.model = declared.backlash_model(parameters or {}, None, stems)
        printed = {v.name: float(v.document or 0.0) for v in self.variables}
        self.design = printed | dict(designs or {})

    def predict(self, table: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Array]:
        count = len(table["unit"])
        one = {name: np.array([value]) for name, value in self.design.items()}
        total = self.model.total(declared.allocation(one))
        phi_2 = _drawn(total.clipped, count, rng)
        return {"backlash_arcmin": (_drawn(total.free, count, rng) + np.maximum(0.0, phi_2)) / ARCMIN}


def _drawn(terms: tuple[Term, ...], count: int, rng: np.random.Generator) -> Array:
    """The sum of one draw of each term for `count` units, shape (count,)."""
    total = np.zeros(count)
    for term in terms:
        z = term.distribution.quantile(rng.random(count))
        bent = 0.0 if term.quadratic is None else term.quadratic * z**2
        total += term.constant + term.linear * z + bent
    return total
