"""Values of formulas in other recipes' values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from ....arrays import Array
from ....claim_records import ComputedTable
from ....errors import ModelError
from ....models.expressions import Formula
from ....units import converted
from ..calculation import Quantity
from .recipe import Recipe, Recomputed


@dataclass(frozen=True, slots=True)
class Constant(Recipe):
    """A number that the document itself prints."""

    value: float
    unit: str

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        return Recomputed((Quantity(self.value, self.unit),))

    @property
    def by(self) -> str:
        return "printed numbers"


@dataclass(frozen=True)
class ByFormula(Recipe):
    """Formulas in named terms; each term enters in its unit, the results are in `unit`."""

    formulas: tuple[Formula, ...]
    terms: Mapping[str, tuple[Recipe, str]]
    unit: str

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        values: dict[str, Array] = {}
        errors: dict[str, float] = {}
        tables: dict[str, ComputedTable] = {}
        for stream, (name, (recipe, unit)) in zip(rng.spawn(len(self.terms)), self.terms.items(), strict=True):
            computed = recipe.recomputed(stream)
            (quantity,) = computed.quantities
            values[name] = np.asarray(converted(quantity.value, quantity.unit, unit))
            zero = converted(0.0, quantity.unit, unit)
            errors[name] = converted(quantity.standard_error, quantity.unit, unit) - zero
            tables.update(computed.tables)
        return Recomputed(tuple(self._quantity(formula, values, errors) for formula in self.formulas), tables)

    def _quantity(self, formula: Formula, values: Mapping[str, Array], errors: Mapping[str, float]) -> Quantity:
        value = float(formula.value(values))
        if not np.isfinite(value):
            shown = ", ".join(f"{name} = {float(term):g}" for name, term in values.items())
            raise ModelError(f"{formula.text} has no value at {shown}")
        slopes = formula.gradient(values)
        error = sqrt(sum((float(slope) * errors[name]) ** 2 for name, slope in slopes.items()))
        return Quantity(value, self.unit, error)

    @property
    def by(self) -> str:
        sources = dict.fromkeys(recipe.by for recipe, _ in self.terms.values())
        return f"formula of {', '.join(sources)}" if sources else "formula of printed numbers"
