"""Changes of inputs compared by likelihood on one batch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from scipy.special import chdtri, ndtri

from ....gap_population_records import InputChange
from ....models.sources import Source
from .input_changes import Change, Tables

OUT_OF_QUESTION = 10.0
"""Tolerances from which the amount that an excluded input would need is no size of a part, and not told."""
UNLIKELY = 0.005
"""Level of each test of whether the best change explains the batch."""
SURE = float((ndtri(0.95) + ndtri(0.9)) ** 2)
"""Squared size, in standard errors, of an effect that is detected nine times out of ten."""


@dataclass(frozen=True)
class Weighed:
    """All changes of inputs on one batch, and those that the batch does not exclude.

    `rival` is the identified effect that is no change of an input, `likely` its log likelihood
    minus the price of its additional parameter.
    """

    tables: Tables
    distance: float
    level: float
    rival: str = ""
    likely: float = -np.inf

    @cached_property
    def _free(self) -> float:
        """The highest log likelihood of any amount, admissible or not."""
        return max(change.free[1] for change in self.tables.changes)

    @property
    def top(self) -> float:
        """The highest log likelihood of all, the rival among them."""
        return max(self._free, self.likely)

    @property
    def gain(self) -> float:
        """Twice the log likelihood ratio of the best change."""
        return 2.0 * (self._free - self.tables.none)

    @property
    def mixed(self) -> bool:
        """Whether the rival explains the batch as well."""
        return 2.0 * (self.top - self.likely) <= self.distance

    def behind(self, change: Change) -> float:
        """Twice the log likelihood by which the best admissible amount is behind the best of all."""
        return 2.0 * (self.top - change.best[1])

    @cached_property
    def standing(self) -> tuple[Change, ...]:
        """The changes that explain the batch as well as any, the best first."""
        changes = [change for change in self.tables.changes if self.behind(change) <= self.distance]
        return tuple(sorted(changes, key=self.behind))

    @cached_property
    def explained(self) -> bool:
        """Whether the residuals of the best of them are only noise."""
        best = self.standing[0]
        below = np.clip(self.tables.shares_below(best, best.best[0]), 1e-9, 1.0 - 1e-9)
        shape = scipy.stats.cramervonmises(below, "uniform").pvalue
        order = scipy.stats.linregress(self.tables.u, ndtri(below)).pvalue
        return bool(min(shape, order) > UNLIKELY)

    def record(self, change: Change, unit: str) -> InputChange:
        """A change as a record, amounts in the input's unit."""
        standing = change in self.standing
        amount = change.best[0] if standing else change.free[0]
        ends = change.interval(float(chdtri(1, 1.0 - self.level)), standing)
        low, high = sorted(change.shown(end) for end in ends)
        shown, share = change.shown(amount), change.share(amount)
        if not standing and abs(share) > OUT_OF_QUESTION:
            shown = low = high = share = np.nan
        return InputChange(
            change.name,
            shown,
            low,
            high,
            change.unit if change.source else unit,
            share,
            self.behind(change),
            "" if standing else self._reason_for_exclusion(change),
            parts_of(change, amount) if standing else 0,
            self._units_to_separate(change) if standing else 0,
        )

    def _reason_for_exclusion(self, change: Change) -> str:
        """Why a change is excluded."""
        amount, log = change.free
        if 2.0 * (self.top - log) > self.distance:
            return "the shape of the batch differs"
        if change.kind != "widening" and abs(change.share(amount)) > OUT_OF_QUESTION:
            return f"all of its tolerance explains {100.0 / abs(change.share(amount)):.2g} % of it"
        if change.kind != "widening":
            return f"it would need {abs(change.share(amount)):.3g} of its tolerance; its parts are inspected"
        if amount < change.low:
            return f"it would need {amount:.3g} of its tolerance, and parts are made over its whole width"
        return f"it would need {amount:.3g} times its tolerance"

    def _units_to_separate(self, change: Change) -> int:
        """The number of units that separate it from the best, by the divergence of their laws."""
        best = self.standing[0]
        if "trend" in (change.kind, best.kind) or change is best:
            return 0
        change_density, best_density = (self.tables.density(o, o.best[0]) for o in (change, best))
        probability = np.exp(best_density) * self.tables.law.step
        apart = float(probability @ (best_density - change_density))
        # below a distance of 0.01 in 10,000 units the laws are practically the same
        return int(np.ceil(self.distance / (2.0 * apart))) if apart > 5e-7 else 0


def parts_of(change: Change, amount: float) -> int:
    """The number of parts whose measurement would show the change of an input."""
    if change.source is None:
        return 0
    fraction = change.share(amount)
    scatter, peaked = _scatter(change.source)
    if change.kind == "widening":
        size = np.log(fraction) ** 2 if fraction > 1.0 else 0.0
        variance = 0.25 * (peaked - 1.0)
    else:
        size = fraction**2 * (1.0 if change.kind == "shift" else 1.0 / 12.0)
        variance = scatter
    return int(max(np.ceil(SURE * variance / size), 3)) if size > 0.0 else 0


def _scatter(source: Source) -> tuple[float, float]:
    """Variance of an input in squared tolerances, and its kurtosis."""
    raw = source.law.raw_moments(4)
    mean, second = raw[1], raw[2] - raw[1] ** 2
    fourth = raw[4] - 4.0 * mean * raw[3] + 6.0 * mean**2 * raw[2] - 3.0 * mean**4
    return float(second), float(fourth / second**2)
