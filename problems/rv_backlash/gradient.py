"""Derivatives of cost and of the geometric backlash with respect to every variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.propagation.sums import Term, total_cumulants
from ...units import ARCMIN, MM
from .form import deviations
from .machined_tolerances import TERMS
from .terms import BEARING, GRADE

if TYPE_CHECKING:
    from .problem import RvBacklash


def gradients(problem: RvBacklash, designs: Array) -> dict[str, Array]:
    """d output / d variable, shape (n, all variables), in the units of output and variable.

    A term constant + a t z + b t^2 z^2 has mean and variance that are polynomials in its tolerance
    t, so both derivatives are exact. The grade counts as continuous (sqrt(2) per grade).
    """
    total = problem.total(designs)
    terms = dict(zip(TERMS, total.clipped, strict=True))
    mean, variance = np.zeros_like(designs), np.zeros_like(designs)
    phi_1, phi_3 = total.free
    spread = problem.effective(designs)
    slopes = {name: _by_tolerance(t, problem.column(spread, name)) for name, t in terms.items()}
    for tolerance in problem.machined_tolerances.values():
        t, chosen = problem.column(designs, tolerance.name), problem.chosen(designs, tolerance)
        rise, shift = tolerance.slopes(t, chosen)
        (by_mean, by_variance), x = slopes[tolerance.name], problem.column(spread, tolerance.name)
        shift = shift * problem.model.moves(tolerance.name.removesuffix("_um"))
        of_mean, of_variance = _by_middle(terms[tolerance.name], x)
        slopes[tolerance.name] = (by_mean * rise + of_mean * shift, by_variance * rise + of_variance * shift)
    slopes[BEARING] = _scaled(phi_3, 1.0 / problem.column(designs, BEARING))
    slopes[GRADE] = _scaled(phi_1, 0.5 * np.log(2.0))
    for name, pair in slopes.items():
        at = problem.names.index(name)
        mean[:, at], variance[:, at] = pair
    model = problem.model
    unit = 2.0 * model.output_factor / model.geometry.lever
    fixed = {
        "stagger_arcmin": -model.output_factor * model.stagger_gain * ARCMIN,
        "dr_rp_mm": unit * MM,
        "dr_p_mm": -unit * model.geometry.flank * MM,
    }
    for name, slope in fixed.items():
        mean[:, problem.names.index(name)] = slope
    std = np.sqrt(total_cumulants(total.clipped + total.free)[1])
    deviation = 0.5 * variance / std[:, None] * (1.0 + problem.change.growth)
    return {
        "cost": problem.cost_slopes(designs),
        "backlash_geometric_arcmin": (mean + deviations(problem) * deviation) / ARCMIN,
        "backlash_geometric_mean_arcmin": mean / ARCMIN,
        "backlash_geometric_std_arcmin": deviation / ARCMIN,
    }


def _by_tolerance(term: Term, t: Array) -> tuple[Array, Array]:
    """d mean/dt and d variance/dt of a term whose linear part grows with t, the bent with t^2."""
    _, m1, m2, m3, m4 = term.distribution.raw_moments(4)
    linear = term.linear / t
    bent = 0.0 if term.quadratic is None else term.quadratic / t**2
    mean = linear * m1 + 2.0 * bent * t * m2
    variance = (
        2.0 * linear**2 * t * (m2 - m1**2)
        + 6.0 * linear * bent * t**2 * (m3 - m1 * m2)
        + 4.0 * bent**2 * t**3 * (m4 - m2**2)
    )
    return mean, variance


def _by_middle(term: Term, x: Array) -> tuple[Array, Array]:
    """d mean/dm and d variance/dm of a normal term (b + 2 q m) x z + q (x z)^2 about its mean m."""
    if term.quadratic is None:
        return term.linear / x, np.zeros_like(x)
    square = term.distribution.raw_moments(2)[2]
    return term.linear / x, 4.0 * term.linear * term.quadratic / x * square


def _scaled(term: Term, rate: Array | float) -> tuple[Array, Array]:
    """The same of a term that grows as a whole at the relative `rate`."""
    mean, variance = term.cumulants()[:2]
    return mean * rate, 2.0 * variance * rate
