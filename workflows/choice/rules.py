"""The rules by which a point of a front is chosen, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .knees import best_trade_off, farthest_from_chord, largest_product, scaled, sharpest_bend
from .weighted import by_pseudo_weights, by_topsis

Array = NDArray[np.float64]
COST = "cost"
MEANINGS: Mapping[str, str] = {
    "knee": "largest distance to the chord between the ends",
    "knee_plane": "largest distance to the plane through the ends",
    "knee_bend": "largest bend, with arms of a tenth of the front",
    "knee_tradeoff": "every move away loses most for what it gains",
    "nash": "largest product of the gains over the worst of the front",
    "pseudo_weights": "pseudo-weights nearest to the weights",
    "topsis": "closest to the ideal by TOPSIS with the weights",
    "cheapest_within_limits": "cheapest point that keeps [choice] limits",
    "best_for_budget": "best point that costs no more than [choice] budget",
    "only": "the one point of the front",
}


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """A front as the rules see it.

    `objectives` (n, m) are called `names`, `cost` (n,) what each point costs, `weights` (m,)
    add up to one, `kept` (n,) says which points keep the limits of the choice, None without any.
    """

    objectives: Array
    names: tuple[str, ...]
    cost: Array | None
    weights: Array
    kept: NDArray[np.bool_] | None = None
    budget: float | None = None


def chosen(points: Points) -> dict[str, int]:
    """The row that each rule chooses; rules that do not apply, or find none, are left out."""
    values = points.objectives
    if not len(values):
        return {}
    if values.shape[1] == 1:
        return {"only": int(np.argmin(values[:, 0]))}
    found = {
        "knee" if values.shape[1] == 2 else "knee_plane": farthest_from_chord(values),
        "knee_bend": sharpest_bend(values),
        "knee_tradeoff": best_trade_off(values),
        "nash": largest_product(values),
        "pseudo_weights": by_pseudo_weights(values, points.weights),
        "topsis": by_topsis(values, points.weights),
        "cheapest_within_limits": _cheapest(points),
        "best_for_budget": _best(points),
    }
    return {name: at for name, at in found.items() if at is not None}


def _cheapest(points: Points) -> int | None:
    if points.kept is None or points.cost is None or not np.any(points.kept):
        return None
    return int(np.argmin(np.where(points.kept, points.cost, np.inf)))


def _best(points: Points) -> int | None:
    """Least weighted sum of the other objectives, scaled, among the points within the budget."""
    if points.budget is None or points.cost is None:
        return None
    within = points.cost <= points.budget
    others = [at for at, name in enumerate(points.names) if name != COST]
    if not np.any(within) or not others:
        return None
    sums = scaled(points.objectives)[:, others] @ np.maximum(points.weights[others], 1e-12)
    return int(np.argmin(np.where(within, sums, np.inf)))
