"""The likelihood of effects on the scatter of units, and its threshold under the null model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy import optimize, special

from ...arrays import Array
from ...models.effects.compose import Active
from ...models.effects.effect import EffectParameter, Target
from ...models.effects.population.law import Law
from .distance import likelier
from .law import law_with
from .library import Candidate, carried
from .plan import GapPlan

GROWTHS = np.geomspace(1.03, 4.0, 24) - 1.0
STEPS = np.linspace(0.75, 5.0, 12)
SHARES = np.array([0.06, 0.12, 0.25, 0.5, 0.75, 0.88])
FARTHEST = 20.0
MOST = 400
"""Units of a simulated batch; a likelihood ratio does not depend on their number. Also the most
starting points of a fit."""


@dataclass(frozen=True)
class Kind:
    """The search of a parameter: values to start from, coarse values for the threshold, bounds, and
    the step of its second derivative.
    """

    starts: Array
    coarse: Array
    bounds: tuple[float, float]
    step: float


@dataclass(frozen=True)
class BatchLikelihood:
    """The likelihood of deviations (n,) from the model's mean, given an effect on their scatter.

    Its parameters are `p` (k,); those in the output's unit count in standard deviations of the law.
    """

    candidate: Candidate
    law: Law
    target: Target
    about_mean: bool = False
    """Whether the deviations are from the mean of the units instead of the model's."""

    @property
    def numbers(self) -> tuple[EffectParameter, ...]:
        """The fitted parameters."""
        return self.candidate.parameters

    @cached_property
    def scale(self) -> Array:
        """The scale (k,) of each parameter, in its unit."""
        unit = self.target.outputs[0].unit
        return np.array([self.law.std if unit and parameter.unit == unit else 1.0 for parameter in self.numbers])

    def _kinds(self) -> list[Kind]:
        return list(map(self._kind, self.numbers, self.scale.tolist()))

    def _kind(self, parameter: EffectParameter, scale: float) -> Kind:
        low, high = max(parameter.low / scale, -FARTHEST), min(parameter.high / scale, FARTHEST)
        if parameter.unit == self.target.outputs[0].unit:
            both = np.concatenate([-STEPS, STEPS]) if low < 0.0 else STEPS
            return Kind(both, both[::3], (low, high), 0.1)
        if np.isfinite([parameter.low, parameter.high]).all():
            inside = SHARES if low >= 0.0 and high <= 1.0 else low + (high - low) * SHARES
            return Kind(inside, inside[:4:2], (low, high), 0.005 * (high - low))
        both = np.concatenate([-GROWTHS, GROWTHS]) if low < 0.0 else GROWTHS
        return Kind(both, both[::2], (low, high), 0.05)

    def _grid(self, coarse: bool) -> Array:
        """Starting points (m, k)."""
        axes = [kind.coarse if coarse else kind.starts for kind in self._kinds()]
        while np.prod([len(axis) for axis in axes]) > MOST:
            axes = [axis[::2] for axis in axes]
        return np.array(list(product(*axes)), dtype=np.float64)

    def values(self, p: Array) -> dict[str, float]:
        """Parameters by name, in their units."""
        named = zip(self.numbers, np.asarray(p) * self.scale, strict=True)
        return {parameter.name: float(value) for parameter, value in named}

    def changed(self, p: Array) -> Law:
        """The law with the effect at parameters p (k,)."""
        return law_with(self.law, self.candidate.effect, self.values(p), self.target)

    def __call__(self, x: Array, p: Array) -> float:
        """The log likelihood of deviations (n,)."""
        moved = self.mean(p) if self.about_mean else 0.0
        return float(self.changed(p)(x + moved).sum())

    def mean(self, p: Array) -> float:
        """The shift of the mean by the effect."""
        return carried([Active(self.candidate.effect, self.values(p))], self.target)

    def best(self, x: Array, start: Array | None = None) -> Array:
        """The likeliest parameters (k,)."""
        starts = self._grid(False) if start is None else start[None]

        def worse(p: Array) -> float:
            return -self(x, p)

        optimum = optimize.minimize(
            worse,
            min(starts, key=worse),
            method="Nelder-Mead",
            bounds=[kind.bounds for kind in self._kinds()],
            options={"xatol": 1e-4, "fatol": 1e-3},
        )
        return np.asarray(optimum.x)

    def log_densities_on_grid(self, at: Array) -> list[Array]:
        """Log densities (k,) about their mean, at the coarse grid of the parameters."""
        return [self.changed(p)(at + self.mean(p)) for p in self._grid(True)]

    def half_widths(self, x: Array, at: Array, level: float) -> Array:
        """Half-widths (k,) of intervals from the curvature in all parameters jointly."""
        from statsmodels.tools.numdiff import approx_hess  # imports all distributions of scipy

        steps = np.array([kind.step for kind in self._kinds()])
        bend = np.atleast_2d(approx_hess(at, lambda p: -self(x, p), epsilon=steps))
        variance = np.diag(np.linalg.pinv(bend))
        return np.asarray(special.ndtri(0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 1e-12)))


def threshold(law: Law, candidates: Sequence[Candidate], target: Target, count: int, plan: GapPlan) -> float:
    """The threshold: a quantile of the best of all effects on batches drawn from the null model."""
    rng = np.random.default_rng([plan.seed, 6])
    shape = (plan.settings.simulations, min(count, MOST))
    x = law.histogram.rvs(size=shape, random_state=rng)
    x -= x.mean(axis=1, keepdims=True)
    at = np.asarray(x.min() + law.step * (np.arange(1 + int(np.ptp(x) / law.step)) + 0.5))
    tried = [
        log for candidate in candidates for log in BatchLikelihood(candidate, law, target).log_densities_on_grid(at)
    ]
    best = likelier(x, float(at[0]), law.step, np.array(tried) - law(at))
    return float(np.quantile(best, 1.0 - plan.settings.false_rate))
