"""The tolerances of a reducer as its mean square backlash needs them: coefficients and costs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from ...arrays import Array, Integers
from ...models.costs import CostCurve
from ...models.rv_reducer.mean_square import MeanSquare, mean_square
from ...units import ARCMIN
from ..rv_backlash import RvBacklash
from ..rv_backlash.shift import Shift, columns_of, shift_of
from ..rv_backlash.terms import BEARING, GRADE, bearing_term, ends, grades_of, unit_terms

ECCENTRICITY = "eccentricity_um"
INTERFERENCE = "interference_probability"


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Coefficients in arcmin per um; tolerances t (n, 9) of phi_2 with the eccentricity last.

    phi_2 has the mean `constant` + s + bend t_e^2 and the variance sum square_j t_j^2 + bend_square
    t_e^4; phi_1 mean and variance by grade (k,), phi_3 those of a clearance c: slopes by c and c^2.
    s, what modification and stagger leave, lies in [low, high] and keeps mean >= `edge` deviations
    of phi_2 where interference is limited (-inf where not).
    """

    problem: RvBacklash
    names: tuple[str, ...]
    curves: tuple[CostCurve, ...]
    low: Array
    high: Array
    constant: float
    square: Array
    bend: float
    bend_square: float
    grades: Array
    grade_cost: Array
    grade_mean: Array
    grade_variance: Array
    bearing_mean: float
    bearing_variance: float
    shift: Shift
    edge: float

    def with_more(self, lost: float) -> Block:
        """The same with an additional lost motion [arcmin] of every unit."""
        return replace(self, grade_mean=self.grade_mean + lost) if lost else self

    def of_phi_2(self, t: Array) -> tuple[Array, Array]:
        """Mean less s, and variance (n,) of phi_2 at tolerances t (n, 9)."""
        bent = t[..., -1] ** 2
        variance = t**2 @ self.square + self.bend_square * bent**2
        return self.constant + self.bend * bent, variance

    def least_shift(self, mean: Array, variance: Array) -> Array:
        """The s (n,) of least backlash at a mean less s and a variance of phi_2."""
        if not np.isfinite(self.edge):
            return np.full_like(mean, self.shift.low)
        return np.clip(self.edge * np.sqrt(variance) - mean, self.shift.low, self.shift.high)

    def backlash(self, t: Array, bearing: Array, grade: Integers, s: Array) -> MeanSquare:
        """E b^2 [arcmin^2] of designs: `grade` is a place among `grades`."""
        mean, variance = self.of_phi_2(t)
        free = self.grade_mean[grade] + self.bearing_mean * bearing
        free_variance = self.grade_variance[grade] + self.bearing_variance * bearing**2
        return mean_square(free, free_variance, mean + s, variance)

    def cost(self, t: Array, bearing: Array, grade: Integers) -> Array:
        """Cost (n,) of designs."""
        every = np.concatenate([t, bearing[..., None]], axis=-1)
        costs = [curve.cost(every[..., at]) for at, curve in enumerate(self.curves)]
        return np.asarray(np.sum(costs, axis=0) + self.grade_cost[grade])

    def designs(self, t: Array, bearing: Array, grade: Integers, s: Array) -> Array:
        """Full designs (n, all variables) of the reducer's problem."""
        columns = dict(zip(self.names, (*t.T, bearing), strict=True))
        columns |= {GRADE: self.grades[grade], **columns_of(self.problem, self.shift, s)}
        return np.stack([np.asarray(columns[name]) for name in self.problem.names], axis=1)

    def of_designs(self, designs: Array) -> Array:
        """E b^2 (n,) [arcmin^2] of full designs of the reducer's problem."""
        p = self.problem
        t = np.stack([p.column(designs, name) for name in self.names[:-1]], axis=1)
        grade = np.searchsorted(self.grades, p.column(designs, GRADE)).astype(np.int64)
        unit = p.profile(designs)["modification_backlash_arcmin"]
        gain = p.model.output_factor * p.model.stagger_gain
        s = unit - gain * p.column(designs, "stagger_arcmin")
        return self.backlash(t, p.column(designs, BEARING), grade, s).value


def block_of(problem: RvBacklash) -> Block | str:
    """The coefficients of a reducer's problem, or why it has none."""
    shift = shift_of(problem)
    if shift is None:
        return "its ranges and limits leave the modification no room"
    if problem.change.growth != 0.0:
        return "an effect inflates its spread, which the closed form does not know"
    terms = unit_terms(problem)
    names = tuple(sorted(terms, key=lambda name: name == ECCENTRICITY))
    moments = [terms[name].distribution.raw_moments(4) for name in names]
    if any(abs(m[1]) > 1e-12 or abs(m[3]) > 1e-12 for m in moments):
        return "its errors must be even about their mid-limits"
    linear = np.array([float(terms[name].linear[0]) for name in names]) / ARCMIN
    square = linear**2 * np.array([m[2] for m in moments])
    last = terms[names[-1]]
    q = 0.0 if last.quadratic is None else float(last.quadratic[0]) / ARCMIN
    if q > 0.0:
        return "the eccentricity's mean must bend down"
    grades, phi_1 = grades_of(problem)
    by_grade, by_bearing = phi_1.cumulants(), bearing_term(problem).cumulants()
    ranges = np.array([ends(problem, name) for name in (*names, BEARING)])
    limit = next((bound.high for bound in problem.limits if bound.name == INTERFERENCE), 1.0)
    constant = sum(float(term.constant[0]) for term in terms.values())
    return Block(
        problem=problem,
        names=(*names, BEARING),
        curves=tuple(problem.settings.costs[name] for name in (*names, BEARING)),
        low=ranges[:, 0],
        high=ranges[:, 1],
        constant=(constant + problem.change.effective) / ARCMIN,
        square=square,
        bend=q * moments[-1][2],
        bend_square=q**2 * (moments[-1][4] - moments[-1][2] ** 2),
        grades=grades,
        grade_cost=problem.settings.costs[GRADE].cost(grades),
        grade_mean=by_grade[0] / ARCMIN,
        grade_variance=by_grade[1] / ARCMIN**2,
        bearing_mean=float(by_bearing[0][0]) / ARCMIN,
        bearing_variance=float(by_bearing[1][0]) / ARCMIN**2,
        shift=shift,
        edge=float(ndtri(1.0 - limit)) if limit < 1.0 else -np.inf,
    )
