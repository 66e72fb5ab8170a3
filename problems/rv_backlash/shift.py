"""The joint effect of modification and stagger on phi_2: one shift s, and designs that have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...arrays import Array
from ...units import ARCMIN, MM
from .terms import ends

if TYPE_CHECKING:
    from .problem import RvBacklash

SHIFT = "phi_2_shift"
"""The shift as a feature of a form: s - low + 1."""
TRIED = 101
"""Modifications of a shift that are tried for the limits that are not linear."""
INSIDE = 1e-9
"""Distance [mm] that a modification keeps from its limits, against rounding."""


@dataclass(frozen=True)
class Shift:
    """Range [arcmin] of s = play of the modification - stagger, and where its ends are.

    `pairs` (2, 2) are modifications (dr_rp, dr_p) [mm] of least and of most play, `plays` (2,)
    those plays, `stagger` (2,) its range [arcmin] and `gain` what an arcmin of it takes from phi_2.
    """

    pairs: Array
    plays: Array
    stagger: Array
    gain: float

    @property
    def low(self) -> float:
        """Least s."""
        return float(self.plays[0] - self.gain * self.stagger[1])

    @property
    def high(self) -> float:
        """Largest s."""
        return float(self.plays[1] - self.gain * self.stagger[0])


def profile_at(problem: RvBacklash, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Outputs of the tooth modification (n,) at some columns (n,) of otherwise tight designs."""
    designs = np.repeat(problem.complete(np.atleast_2d(problem.xl)), len(next(iter(columns.values()))), axis=0)
    for name, column in columns.items():
        designs[:, problem.names.index(name)] = column
    return problem.profile(designs)


def play_slopes(problem: RvBacklash) -> Array:
    """d phi_2 [arcmin] / d (dr_rp, dr_p) [mm], (2,)."""
    model = problem.model
    unit = 2.0 * model.output_factor / model.geometry.lever / ARCMIN * MM
    return unit * np.array([1.0, -model.geometry.flank])


def shift_of(problem: RvBacklash) -> Shift | None:
    """The range of s in ranges and limits, None where these leave no room."""
    slopes = play_slopes(problem)
    least, most = (extreme_pair(problem, side * slopes) for side in (1.0, -1.0))
    if least is None or most is None:
        return None
    extremes = np.array([least, most])
    gain = problem.model.output_factor * problem.model.stagger_gain
    return Shift(extremes, extremes @ slopes, np.array(ends(problem, "stagger_arcmin")), gain)


def extreme_pair(problem: RvBacklash, goal: Array) -> tuple[float, float] | None:
    """The pair (dr_rp, dr_p) [mm] of least goal . pair in ranges and limits, None without room."""
    limits = {limit.name: limit for limit in problem.limits}
    above, below = [], []
    rows = (("radial_gap_mm", np.array([1.0, -1.0])), ("modification_backlash_arcmin", play_slopes(problem)))
    for name, row in rows:
        if name in limits:
            above += [-row, row]
            below += [-limits[name].low, limits[name].high]
    real = np.isfinite(below)
    solution = scipy.optimize.linprog(
        goal,
        A_ub=np.array(above)[real] if real.any() else None,
        b_ub=np.array(below)[real] if real.any() else None,
        bounds=[ends(problem, "dr_rp_mm"), ends(problem, "dr_p_mm")],
    )
    return (float(solution.x[0]), float(solution.x[1])) if solution.x is not None else None


def columns_of(problem: RvBacklash, shift: Shift, s: Array) -> dict[str, Array]:
    """Modification and stagger (n,) of shifts (n,): no more stagger than they need.

    Among the modifications of one play, the one with the largest margin to its limits is taken.
    """
    low, high = shift.plays
    play = np.clip(s + shift.gain * shift.stagger[0], low, high)
    stagger = np.clip((play - s) / shift.gain, *shift.stagger)
    pairs = np.array([_roomiest(problem, float(design_play)) for design_play in play])
    return {"dr_rp_mm": pairs[:, 0], "dr_p_mm": pairs[:, 1], "stagger_arcmin": stagger}


def _roomiest(problem: RvBacklash, play: float) -> tuple[float, float]:
    """The modification [mm] of a play [arcmin] whose least margin to its limits is largest."""
    slopes = play_slopes(problem)
    first, second = ends(problem, "dr_rp_mm"), ends(problem, "dr_p_mm")
    along = np.array([(play - slopes[1] * end) / slopes[0] for end in second])
    low, high = max(first[0], along.min()), min(first[1], along.max())
    dr_rp = np.linspace(low, high, TRIED)
    dr_p = np.clip((play - slopes[0] * dr_rp) / slopes[1], *second)
    profile = profile_at(problem, {"dr_rp_mm": dr_rp, "dr_p_mm": dr_p})
    violations = [v for limit in problem.limits if limit.name in profile for v in limit.violations(profile[limit.name])]
    worst = np.max(violations, axis=0) if violations else np.zeros(TRIED)
    at = int(np.argmin(np.maximum(worst, -INSIDE)))
    middle = np.flatnonzero(worst <= worst[at] + INSIDE)
    chosen = int(middle[len(middle) // 2])
    return float(dr_rp[chosen]), float(dr_p[chosen])
