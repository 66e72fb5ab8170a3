"""What the best of all changes of inputs reaches by chance on a batch of the model."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from ....models.inputs.distribution import Array
from .changed_laws import SHIFTS
from .input_changes import Tables

BATCHES = 400
MOST = 400
"""Units of a simulated batch; a likelihood ratio does not depend on their number."""
LEAST = 1e-7
"""Share of a cell below which no unit is ever drawn from it."""


def chance_of(tables: Tables, rate: float, seed: int) -> float:
    """Twice the log likelihood ratio that all but `rate` of the batches of the model stay below.

    Half of the rate is left to trends, which all batches alike have in two ways at most.
    """
    law = tables.law
    rng = np.random.default_rng([seed, 13])
    share = np.exp(tables.base) * law.step
    kept = np.flatnonzero(share > LEAST)
    count = min(len(tables.y), MOST)
    drawn = rng.multinomial(count, share[kept] / share[kept].sum(), BATCHES).astype(float)
    gains = drawn @ (_tried(tables)[:, kept] - tables.base[kept]).T
    still = float(np.quantile(2.0 * gains.max(axis=1).clip(0.0), 1.0 - 0.5 * rate))
    return max(still, float(chdtri(1, 0.25 * rate)))


def _tried(tables: Tables) -> Array:
    """Log densities (m, k) of changes that stand for all."""
    near = np.abs(SHIFTS) < 1.5
    moved = tables.laws.moved[near[::3]]
    wide = [table[::2] for _, table in tables.laws.wider]
    return np.vstack([tables.shifts[near][::2], moved, *wide, tables.laws.blurred[1::2]])
