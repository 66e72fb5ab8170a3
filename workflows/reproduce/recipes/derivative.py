"""A sensitivity: the derivative of a recipe by one of its inputs."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from ..calculation import Quantity
from .recipe import Recipe, Recomputed


@dataclass(frozen=True, slots=True)
class Derivative(Recipe):
    """Central difference of all values of `recipe`, by the input `name`, over +-`step`.

    Both ends take the same random numbers, so that the standard error stated is an upper bound.
    """

    recipe: Recipe
    name: str
    step: float

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        ends = [
            self.recipe.shifted(self.name, sign * self.step).recomputed(deepcopy(rng)).quantities
            for sign in (1.0, -1.0)
        ]
        per = self.recipe.unit_of(self.name) or "1"
        return Recomputed(
            tuple(
                Quantity(
                    (high.value - low.value) / (2.0 * self.step),
                    high.unit if per == "1" else f"({high.unit})/({per})",
                    float(np.hypot(high.standard_error, low.standard_error)) / (2.0 * self.step),
                )
                for high, low in zip(*ends, strict=True)
            )
        )

    @property
    def by(self) -> str:
        return f"derivative by {self.name} of {self.recipe.by}"
