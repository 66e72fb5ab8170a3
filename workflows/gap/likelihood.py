"""The likelihood of effects on the scatter of units, and what it reaches by chance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats
from statsmodels.tools.numdiff import approx_hess

from ...models.inputs.distribution import Array
from .law import Law, mixture
from .plan import GapPlan

GROWTHS = np.geomspace(1.03, 4.0, 24) - 1.0
STEPS = np.concatenate([-np.linspace(0.75, 5.0, 12), np.linspace(0.75, 5.0, 12)])
SHARES = (0.06, 0.12, 0.25, 0.5, 0.75, 0.88)
MOST = 400
"""Units of a simulated batch; a likelihood ratio does not depend on their number."""


def threshold(law: Law, count: int, plan: GapPlan) -> float:
    """What the better of both reaches on batches that are drawn from the model.

    The units are counted in the cells of a lattice, so that a likelihood is a product.
    """
    rng = np.random.default_rng([plan.seed, 6])
    shape = (plan.settings.simulations, min(count, MOST))
    x = law.histogram.rvs(size=shape, random_state=rng)
    x -= x.mean(axis=1, keepdims=True)
    low, cells = float(x.min()), 1 + int(np.ptp(x) / law.step)
    cell = ((x - low) / law.step).astype(np.int64) + cells * np.arange(len(x))[:, None]
    counts = np.bincount(cell.ravel(), minlength=cells * len(x)).reshape(len(x), cells)
    at = np.asarray(low + law.step * (np.arange(cells) + 0.5), dtype=np.float64)
    tried = [law.widened(growth)(at) for growth in GROWTHS[::2]]
    tried += [mixture(law, at + share * step, step, share)
              for step in STEPS[::3] * law.std for share in SHARES[:4:2]]  # fmt: skip
    gains = counts.astype(float) @ (np.column_stack(tried) - law(at)[:, None])
    best = np.maximum(gains.max(axis=1), 0.0)
    return float(np.quantile(2.0 * best, 1.0 - plan.settings.false_rate))


Likelihood = Callable[[Array, Array], float]
"""Log likelihood of deviations (n,) at the parameters (k,) of an effect on their scatter."""


@dataclass(frozen=True)
class Kind:
    """How one effect acts on the law, and its likelihood: starting points (m, k), bounds, the scale
    (k,) of each parameter in the output's unit, steps (k,) that its curvature is taken over, and
    by how much it moves the mean.
    """

    likelihood: Likelihood
    starts: Array
    bounds: list[tuple[float, float]]
    scale: Array
    steps: Array
    mean: Callable[[Array], float]
    law: Callable[[Array], Law]

    def best(self, x: Array, start: Array | None = None) -> Array:
        """The likeliest parameters (k,)."""
        starts = self.starts if start is None else start[None]

        def worse(p: Array) -> float:
            return -self.likelihood(x, p)

        found = optimize.minimize(
            worse, min(starts, key=worse), method="Nelder-Mead", bounds=self.bounds,
            options={"xatol": 1e-4, "fatol": 1e-3},
        )  # fmt: skip
        return np.asarray(found.x)

    def about_mean(self, x: Array, p: Array) -> float:
        """The likelihood with the mean where it fits: that of the units is the population's."""
        return self.likelihood(x + self.mean(p), p)


def kind_of(name: str, law: Law) -> Kind:
    """The effect of that name on the scatter of a law."""
    if name == "spread_inflation":
        return Kind(
            lambda x, p: float(law.widened(float(p[0]))(x).sum()),
            GROWTHS[:, None], [(0.0, 20.0)], np.ones(1), np.array([0.05]),
            lambda p: 0.0, lambda p: law.widened(float(p[0])),
        )  # fmt: skip
    starts = np.array([(step, share) for step in STEPS for share in SHARES])
    return Kind(
        lambda x, p: float(mixture(law, x, float(p[0]) * law.std, float(p[1])).sum()),
        starts, [(-20.0, 20.0), (0.02, 0.98)], np.array([law.std, 1.0]), np.array([0.1, 0.005]),
        lambda p: float(p[0] * p[1]) * law.std,
        lambda p: law.mixed(float(p[0]) * law.std, float(p[1])),
    )  # fmt: skip


def half_widths(kind: Kind, x: Array, at: Array, level: float) -> Array:
    """Half-widths (k,) of intervals from the curvature of the likelihood, all numbers together."""
    bend = np.atleast_2d(approx_hess(at, lambda p: -kind.likelihood(x, p), epsilon=kind.steps))
    variance = np.diag(np.linalg.pinv(bend))
    return np.asarray(stats.norm.ppf(0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 1e-12)))
