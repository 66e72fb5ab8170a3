"""The convex form of a machine of links and reducers.

Every requirement is a root of a sum of squares: variances of links, E b^2 and W of reducers. What a
reducer costs at an rms of its backlash is a convex curve per grade (problems/reducers), each a way
of making it; its transmission error has a curve in closed form. The curves are lower bounds, by at
most 1e-5 of their cost, so that what is proven of the form is proven of all tolerances.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...models.costs import CostCurve
from ..forms import Feature, Form, Way
from ..limits import narrowed
from .gears import RMS, TE
from .outputs import AXES, STANDS
from .waves import SECONDS

if TYPE_CHECKING:
    from .problem import RobotProblem

TE_OUTPUT = "te_amplitude_arcsec"


def form_of(problem: RobotProblem) -> Form | None:
    """The form; None where a reducer's front is not proven."""
    if not problem.gears.proven:
        return None
    gears = problem.gears.nested
    shared = ["pose_rms_mm", "squareness_mrad", "yaw_mrad", "reversal_mm", "path_te_mm"]
    outputs = [*shared, *(["backlash_rms_arcmin"] * len(gears)), *([TE_OUTPUT] * len(gears))]
    features = [*_of_gears(problem, len(outputs)), *_of_links(problem, len(outputs))]
    base = (problem.gears.wave.base * problem.gears.largest[1]).tolist()
    offset = np.array([*[0.0] * (len(outputs) - len(base)), *base])
    asked = (*outputs, "cost", *STANDS.values(), *(v.name for v in problem.variables))
    relaxed = tuple(
        limit.name
        for limit in problem.limits
        if limit.name not in asked or (np.isfinite(limit.low) and limit.name not in problem.names)
    )
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    return Form(
        tuple(outputs),
        tuple(features),
        offset,
        _constant(problem, outputs),
        "rms of the position error (first order) and proven fronts of the reducers, phi_2 normal" + left_out,
        exact=False,
        relaxed=relaxed,
        stands=STANDS,
    )


def _constant(problem: RobotProblem, outputs: list[str]) -> Array:
    """Squares that no tolerance changes: the hysteresis of drives whose flank is held."""
    mean, gears = problem.machine.squares, problem.gears
    lost = 0.25 * (gears.hysteresis * gears.factors) ** 2
    squares = np.zeros(len(outputs))
    for row, name in enumerate(AXES):
        squares[row] = float((mean[f"{name}wave"] - mean[f"{name}backlash"]) @ lost)
    return squares


def _of_gears(problem: RobotProblem, rows: int) -> list[Feature]:
    spreads = [_spreads(problem, gear, rows) for gear in range(len(problem.gears.nested))]
    play = [_of_backlash(problem, gear, spread[0]) for gear, spread in enumerate(spreads)]
    return play + [_of_wave(problem, gear, spread[1]) for gear, spread in enumerate(spreads)]


def _spreads(problem: RobotProblem, gear: int, rows: int) -> Array:
    """Coefficients (2, rows) of a gear's rms backlash [arcmin] and rms wave [arcsec]."""
    mean, gears = problem.machine.squares, problem.gears
    drives = [at for at, gear_of_drive in enumerate(gears.gear_of) if gear_of_drive == gear]
    squares = gears.factors[drives] ** 2, gears.te_factors[drives] ** 2
    play = np.array([float(mean[f"{name}backlash"][drives] @ squares[0]) for name in AXES])
    wave = np.array([float(mean[f"{name}wave"][drives] @ squares[1]) for name in AXES])
    spread = np.zeros((2, rows))
    spread[0, :3], spread[1, :3] = np.sqrt(play / 4.0), SECONDS * np.sqrt(wave)
    spread[0, 3], spread[1, 4] = np.sqrt(play[0]), SECONDS * np.sqrt(2.0 * wave[0])
    spread[0, 5 + gear] = gears.largest[0, gear]
    spread[1, 5 + len(gears.nested) + gear] = gears.largest[1, gear] * gears.wave.least
    return spread


def _of_backlash(problem: RobotProblem, gear: int, spread: Array) -> Feature:
    """A way per grade; the cost of all drives that have the gear is in its curve."""
    reducer, name = problem.gears.nested[gear], f"reducer_{problem.gears.keys[gear]}"
    low, high = _range(problem, f"{name}_{RMS}", reducer.range)
    price = reducer.price * float(problem.gears.counts[gear])
    ways = []
    for curve, grade in zip(reducer.curves, reducer.grades, strict=True):
        ends = max(low, float(curve.t[0])), min(high, float(curve.t[-1]))
        if ends[0] < ends[1]:
            priced = replace(curve, price=price)
            ways.append(_way(priced, ends, spread, float(grade)))
    return Feature(f"{name}_{RMS}", tuple(ways), f"{name}_grade_of_form")


def _of_wave(problem: RobotProblem, gear: int, spread: Array) -> Feature:
    curve, name = problem.gears.wave.curve, f"reducer_{problem.gears.keys[gear]}"
    usual = float(curve.t[0]), float(curve.t[-1])
    low, high = _range(problem, f"{name}_{TE}", usual)
    priced = replace(curve, price=curve.price * float(problem.gears.counts[gear]))
    way = _way(priced, (max(low, usual[0]), min(high, usual[1])), spread)
    return Feature(f"{name}_{TE}", (way,))


def _way(curve: CostCurve, ends: tuple[float, float], spread: Array, choice: float = 0.0) -> Way:
    nothing = (0.0,) * len(spread)
    return Way(curve, *ends, nothing, tuple(spread.tolist()), choice=choice)


def _of_links(problem: RobotProblem, rows: int) -> list[Feature]:
    spreads = np.pad(np.sqrt(problem.machine.links), ((0, rows - 3), (0, 0))).T
    return [
        Feature(name, (_way(problem.settings.costs[name], _range(problem, name, problem.interval(name)), spread),))
        for name, spread in zip(problem.link_names, spreads, strict=True)
    ]


def _range(problem: RobotProblem, name: str, usual: tuple[float, float]) -> tuple[float, float]:
    """Range of a variable within the limits on it."""
    return narrowed(problem.limits, name, *(problem.interval(name) if name in problem.names else usual))
