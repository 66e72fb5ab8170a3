"""What a record can tell of an effect that hides in it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log, nan

import numpy as np
from scipy.optimize import minimize_scalar

from benchmarks.gap.generator.assemblies import Faults, departure
from benchmarks.gap.generator.records import Hidden, Truth
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.scoring.rivals import RIVALS, Rival, coefficients, least_left, without

FAULTS = {"adjustment_gain": "gain", "chain_coupling": "coupling", "springback": "back"}
"""What an effect on an assembly is called there."""
UNTOLD = 10.0
"""What the best fit of a rival leaves, with ln n per extra number, where it cannot be told."""


@dataclass(frozen=True)
class Told:
    """Of one hidden effect: lambda, the names that the record cannot tell from it, and those of
    them whose columns are the same; `value` is its first number by the notes' formula, `left` what
    the best fit of that formula leaves of it, over the noise variance.
    """

    strength: float
    names: frozenset[str]
    twins: frozenset[str]
    name: str = ""
    value: float = nan
    left: float = inf


def told(truth: Truth, one: Hidden) -> Told:
    """What the record can tell from that effect, the other hidden ones known."""
    others = [other.added[:, None] for other in truth.hidden if other is not one]
    free = np.hstack([truth.free, *others])
    own = without(free, one.added)
    strength = float((own**2).sum()) / truth.sigma**2
    extra = own_count(truth, one)
    names, twins, value, of_own = {one.name}, {one.name}, nan, inf
    for rival in RIVALS[truth.kind]:
        least, p = least_left(rival, truth.points, free, one.added)
        left = least / truth.sigma**2
        if rival.name == one.name and left < of_own:
            of_own = left
            value = number_of(truth, one, rival, p, free)
        left_out = left + log(len(truth.points)) * max(rival.count - extra, 0)
        if left_out < UNTOLD:
            names.add(rival.name)
        if left < 1e-9 * strength:
            twins.add(rival.name)
    return Told(strength, frozenset(names), frozenset(twins & names), one.name, value, of_own)


def number_of(truth: Truth, one: Hidden, rival: Rival, p: Array, free: Array) -> float:
    """The first number of a hidden effect by the notes' formula; an assembly is not linear in its
    faults: there the number is that whose departure is nearest.
    """
    if not rival.linear:
        return nan
    value = float(coefficients(rival, p, truth.points, free, one.added)[0])
    fault = FAULTS.get(one.name)
    if fault is None:
        return value

    def away(x: float) -> float:
        return float(((departure(truth.points, Faults(**{fault: x})) - one.added) ** 2).sum())

    ends = min(0.5 * value, 1.5 * value), max(0.5 * value, 1.5 * value)
    return float(minimize_scalar(away, bounds=ends, method="bounded", options={"xatol": 1e-9}).x)


def own_count(truth: Truth, one: Hidden) -> int:
    """Numbers of the truth, by the notes' formula of its name; 1 where it has no name there."""
    found = [rival.count for rival in RIVALS[truth.kind] if rival.name == one.name]
    return found[0] if found else 1
