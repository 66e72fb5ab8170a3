"""The law that the units of a batch scatter by, about the mean of the model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from statsmodels.nonparametric.kde import KDEUnivariate

from ...models.effects.compose import acting
from ...models.effects.readings import readings_of, target_of
from ...models.inputs.distribution import Array
from .library import ON_SCATTER
from .plan import GapPlan

DRAWN = 200_000
"""Units that the density is read from."""
CELLS = 512
SMOOTHED = 0.1
"""Width of the kernel that smooths the drawn units, as a share of their standard deviation."""
LEAST = 1e-12


@dataclass(frozen=True)
class Law:
    """Log density of deviations from the model's mean, on a lattice of `low` + k `step`."""

    low: float
    step: float
    log: Array
    std: float

    def __call__(self, x: Array) -> Array:
        """Log density at deviations x; beyond the lattice it falls as a normal's."""
        lattice = self.low + self.step * np.arange(len(self.log))
        beyond = np.maximum(lattice[0] - x, x - lattice[-1]).clip(0.0) / self.std
        return np.asarray(np.interp(x, lattice, self.log) - 0.5 * beyond**2 - 3.0 * beyond)

    @cached_property
    def histogram(self) -> Any:
        """The same as a distribution of scipy: shares, quantiles, draws."""
        edges = self.low + self.step * (np.arange(len(self.log) + 1) - 0.5)
        return stats.rv_histogram((np.exp(self.log), edges), density=True)

    def widened(self, growth: float) -> Law:
        """Every deviation 1 + growth times as large."""
        by = 1.0 + growth
        return replace(self, low=by * self.low, step=by * self.step,
                       log=self.log - np.log(by), std=by * self.std)  # fmt: skip

    def mixed(self, offset: float, share: float) -> Law:
        """A share of the units off by `offset`: the mean moves by share times offset."""
        low, more = self.low + min(offset, 0.0), int(np.ceil(abs(offset) / self.step))
        x = np.asarray(low + self.step * np.arange(len(self.log) + more), dtype=np.float64)
        std = float(np.sqrt(self.std**2 + share * (1.0 - share) * offset**2))
        return Law(low, self.step, mixture(self, x, offset, share), std)


def mixture(law: Law, x: Array, offset: float, share: float) -> Array:
    """Log density at deviations x where a share of the units is off by `offset`."""
    first, second = np.log1p(-share) + law(x), np.log(share) + law(x - offset)
    return np.asarray(np.logaddexp(first, second))


def law_of(plan: GapPlan, name: str) -> Law:
    """Of the model's units with the effects on their scatter that are in it already, smoothed."""
    drawn = _drawn(plan, name)
    drawn = drawn - drawn.mean()
    std = float(drawn.std())
    smooth = KDEUnivariate(drawn)
    smooth.fit(bw=SMOOTHED * std, gridsize=CELLS, cut=0.5 / SMOOTHED)
    chance = np.maximum(smooth.density, LEAST / std)
    return Law(float(smooth.support[0]), float(np.ptp(smooth.support)) / (CELLS - 1),
               np.log(chance), std)  # fmt: skip


def _drawn(plan: GapPlan, name: str) -> Array:
    """Units of the model, each of them in a lot of its own where lots matter."""
    assert plan.model is not None
    fixed, rng = plan.model.law_sample(), np.random.default_rng([plan.seed, 5])
    count = len(fixed[name]) if fixed else DRAWN
    table = {c.name: _constant(c.text, count) for c in plan.model.columns if c.needed}
    found = fixed or plan.model.predict(table, rng)
    drawn = np.asarray(found[name], dtype=float)
    active = [one for one in plan.active if one.effect.name in ON_SCATTER]
    target = target_of(plan.model, plan.model_name, table)
    for action in acting(active, readings_of(target.columns, table), target):
        assert action.population is not None
        drawn = action.population(drawn, plan.model.means()[name], rng)
    return drawn


def _constant(text: bool, count: int) -> NDArray[Any]:
    labels = np.arange(count)
    found: NDArray[Any] = labels.astype(str) if text else labels * 0.0
    return found
