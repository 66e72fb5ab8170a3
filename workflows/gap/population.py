"""Batches: whether units scatter as the model's population does, or as a wider or a mixed one.

The population itself is the noise. Its density is that of units drawn from the model; effects that
move single units are found as columns, those that change the scatter here, by likelihood.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from ...models.inputs.distribution import Array
from .fit import Fit
from .library import ON_SCATTER, Candidate
from .plan import GapPlan
from .setup import Setup

DRAWN = 200_000
"""Units that the density is read from."""
CELLS = 400
LEAST = 1e-12
GROWTHS = np.geomspace(1.03, 4.0, 24) - 1.0
STEPS = np.concatenate([-np.linspace(0.75, 5.0, 12), np.linspace(0.75, 5.0, 12)])
SHARES = (0.06, 0.12, 0.25, 0.5)
MOST = 400
"""Units of a simulated batch; a likelihood ratio does not depend on their number."""


@dataclass(frozen=True)
class Density:
    """Log density of a population about its mean, on a lattice of `low` + k `step`."""

    low: float
    step: float
    log: Array
    std: float
    sample: Array

    def __call__(self, x: Array) -> Array:
        """Log density at deviations x from the mean; beyond the lattice it falls as a normal's."""
        at = (np.asarray(x) - self.low) / self.step
        inside = np.clip(at, 0.0, len(self.log) - 1.0)
        first = np.minimum(inside.astype(np.int64), len(self.log) - 2)
        share = inside - first
        found = (1.0 - share) * self.log[first] + share * self.log[first + 1]
        beyond = (at - inside) * self.step / self.std
        return np.asarray(found - 0.5 * beyond**2 - 3.0 * np.abs(beyond))


def density(plan: GapPlan, name: str) -> Density:
    """Of the model's units, smoothed by a tenth of a standard deviation."""
    assert plan.model is not None
    table = {c.name: _constant(c.text) for c in plan.model.columns if c.needed}
    rng = np.random.default_rng([plan.seed, 5])
    drawn = np.asarray(plan.model.predict(table, rng)[name], dtype=float)
    drawn = drawn - drawn.mean()
    std = float(drawn.std())
    low, high = float(drawn.min()) - 0.5 * std, float(drawn.max()) + 0.5 * std
    counts, edges = np.histogram(drawn, CELLS, (low, high))
    step = float(edges[1] - edges[0])
    smooth = ndimage.gaussian_filter1d(counts.astype(float), 0.1 * std / step, mode="constant")
    chance = np.maximum(smooth / (DRAWN * step), LEAST / std)
    return Density(low + 0.5 * step, step, np.log(chance), std, drawn)


def _constant(text: bool) -> NDArray[Any]:
    labels = np.arange(DRAWN)
    found: NDArray[Any] = labels.astype(str) if text else labels * 0.0
    return found


@dataclass(frozen=True)
class Scatter:
    """An effect on the scatter: its numbers, intervals, and twice its log likelihood ratio."""

    candidate: Candidate
    numbers: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    gain: float
    threshold: float
    distance: float = 0.0


def scatter(setup: Setup, fit: Fit, library: tuple[Candidate, ...]) -> tuple[Scatter, ...]:
    """Effects on the scatter that the units beside `fit` show, the best first; none as a rule."""
    plan, output = setup.plan, setup.data.outputs[0]
    mine = {one.name: one for one in library if one.name in ON_SCATTER}
    if not mine or not setup.data.target.population:
        return ()
    law = density(plan, output.name)
    left = _left(setup, fit)
    limit = threshold(law, len(left), plan)
    found = [_fitted(law, left, one, limit) for one in mine.values()]
    price = np.log(len(left))
    scores = [-one.gain + price * one.candidate.count for one in found]
    best = min((s for s, one in zip(scores, found, strict=True) if one.gain > limit), default=None)
    if best is None:
        return ()
    near = [
        Scatter(one.candidate, one.numbers, one.intervals, one.gain, limit, score - best)
        for score, one in zip(scores, found, strict=True)
        if score - best <= plan.settings.set_distance and one.gain > 0.5 * limit
    ]
    return tuple(sorted(near, key=lambda one: one.distance))


def _left(setup: Setup, fit: Fit) -> Array:
    """Deviations (n,) of the units from what moves each of them, in the output's unit."""
    moved = setup.base @ fit.free
    for member, coefficients in zip(fit.members, fit.coefficients, strict=True):
        moved = moved + setup.columns.of(member.candidate, member.shape) @ coefficients
    left = setup.residual - moved
    return np.asarray(left - left.mean())


def threshold(law: Density, count: int, plan: GapPlan) -> float:
    """What the better of both reaches on batches that are drawn from the model."""
    rng = np.random.default_rng([plan.seed, 6])
    n = min(count, MOST)
    x = rng.choice(law.sample, (plan.settings.simulations, n))
    x -= x.mean(axis=1, keepdims=True)
    none = law(x).sum(axis=1)
    best = np.zeros(len(x))
    for growth in GROWTHS[::2]:
        best = np.maximum(best, _wider(law, x, growth).sum(axis=1) - none)
    for step in STEPS[::3] * law.std:
        for share in SHARES[::2]:
            best = np.maximum(best, _mixed(law, x, step, share).sum(axis=1) - none)
    return float(np.quantile(2.0 * best, 1.0 - plan.settings.false_rate))


def _wider(law: Density, x: Array, growth: float) -> Array:
    return np.asarray(law(x / (1.0 + growth)) - np.log1p(growth))


def _mixed(law: Density, x: Array, step: float, share: float) -> Array:
    """Log density of a mixture about its own mean."""
    first, second = law(x + share * step), law(x - (1.0 - share) * step)
    return np.asarray(np.logaddexp(np.log1p(-share) + first, np.log(share) + second))


def _fitted(law: Density, x: Array, candidate: Candidate, limit: float) -> Scatter:
    none = float(law(x).sum())
    if candidate.name == "spread_inflation":
        starts = [np.array([growth]) for growth in GROWTHS]
        bounds = [(0.0, 20.0)]

        def worse(p: Array) -> float:
            return -float(_wider(law, x, float(p[0])).sum())
    else:
        starts = [np.array([s, share]) for s in STEPS for share in SHARES]
        bounds = [(-20.0, 20.0), (0.02, 0.98)]

        def worse(p: Array) -> float:
            return -float(_mixed(law, x, float(p[0]) * law.std, float(p[1])).sum())

    start = min(starts, key=worse)
    best = optimize.minimize(worse, start, method="Nelder-Mead", bounds=bounds)
    scale = np.array([1.0] if candidate.name == "spread_inflation" else [law.std, 1.0])
    half = _half_widths(worse, best.x)
    names = [*(one.name for one in candidate.linear), *(one.name for one in candidate.shape)]
    values = dict(zip(names, (best.x * scale).tolist(), strict=True))
    ends = {
        name: (float((value - width) * by), float((value + width) * by))
        for name, value, width, by in zip(names, best.x, half, scale, strict=True)
    }
    return Scatter(candidate, values, ends, -2.0 * (float(best.fun) + none), limit)


def _half_widths(worse: Callable[[Array], float], at: Array) -> Array:
    """Half-widths of 90 % intervals from the curvature of the likelihood."""
    found = []
    for k, value in enumerate(at):
        step = np.zeros(len(at))
        step[k] = 0.05 * max(abs(float(value)), 0.1)
        bend = (worse(at + step) - 2.0 * worse(at) + worse(at - step)) / step[k] ** 2
        found.append(1.645 / np.sqrt(max(float(bend), 1e-12)))
    return np.array(found)
