"""The rules of choice that come with tolevo."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...problems.settings import Bound
from .knees import best_trade_off, farthest_from_chord, largest_product, scaled, sharpest_bend
from .rule import COST, ChoiceRule, Points
from .settings import ChoiceSettings
from .weighted import by_pseudo_weights, by_topsis


class Knee(ChoiceRule):
    """Largest distance to the chord between the ends of a front of two objectives (Das 1999)."""

    meaning = "largest distance to the chord between the ends"

    def row(self, points: Points) -> int | None:
        return farthest_from_chord(points.objectives) if len(points.names) == 2 else None


class KneePlane(ChoiceRule):
    """Largest distance to the plane through the ends of a front of more objectives (Das 1999)."""

    meaning = "largest distance to the plane through the ends"

    def row(self, points: Points) -> int | None:
        return farthest_from_chord(points.objectives) if len(points.names) > 2 else None


class KneeBend(ChoiceRule):
    """Largest bend, with arms of a tenth of the length of the front (after Branke et al. 2004)."""

    meaning = "largest bend, with arms of a tenth of the front"

    def row(self, points: Points) -> int | None:
        return sharpest_bend(points.objectives)


class KneeTradeoff(ChoiceRule):
    """Every move away loses most for what it gains (Rachmawati & Srinivasan 2009)."""

    meaning = "every move away from it loses most relative to what it gains"

    def row(self, points: Points) -> int | None:
        return best_trade_off(points.objectives)


class Nash(ChoiceRule):
    """Largest product of the gains over the worst of the front (Nash 1950)."""

    meaning = "largest product of the gains over the worst of the front"

    def row(self, points: Points) -> int | None:
        return largest_product(points.objectives)


class PseudoWeights(ChoiceRule):
    """Pseudo-weights nearest to the weights (Deb 2001)."""

    meaning = "pseudo-weights nearest to the weights"

    def row(self, points: Points) -> int | None:
        return by_pseudo_weights(points.objectives, points.weights)


class Topsis(ChoiceRule):
    """Closest to the ideal by TOPSIS with the weights (Hwang & Yoon 1981)."""

    meaning = "closest to the ideal by TOPSIS with the weights"

    def row(self, points: Points) -> int | None:
        return by_topsis(points.objectives, points.weights)


class CheapestWithinLimits(ChoiceRule):
    """Cheapest point that keeps the limits of `[choice.limits]`."""

    meaning = "cheapest point that keeps [choice] limits"

    def row(self, points: Points) -> int | None:
        if points.kept is None or points.cost is None or not np.any(points.kept):
            return None
        return int(np.argmin(np.where(points.kept, points.cost, np.inf)))

    def limits(self, settings: ChoiceSettings) -> Mapping[str, Bound]:
        return settings.limits


class BestForBudget(ChoiceRule):
    """Best point that costs no more than the budget: least weighted sum of the other objectives."""

    meaning = "best point that costs no more than [choice] budget"

    def row(self, points: Points) -> int | None:
        if points.budget is None or points.cost is None:
            return None
        within = points.cost <= points.budget
        others = [at for at, name in enumerate(points.names) if name != COST]
        if not np.any(within) or not others:
            return None
        weights = np.maximum(points.weights[others], 1e-12)
        sums = scaled(points.objectives)[:, others] @ weights
        return int(np.argmin(np.where(within, sums, np.inf)))

    def limits(self, settings: ChoiceSettings) -> Mapping[str, Bound]:
        return {} if settings.budget is None else {COST: Bound(high=settings.budget)}
