"""The convex form of a machine of links and reducers.

Every requirement is a root of a sum of squares: variances of links, E b^2 and W of reducers. What a
reducer costs at an rms of its backlash is a convex curve per grade (problems/reducers), each a way
of making it; its transmission error has a curve in closed form. The curves are lower bounds, by at
most 1e-5 of their cost, so that what is proven of the form is proven of all tolerances.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..forms import Feature, Form, Way
from .gears import RMS, TE
from .outputs import STANDS
from .waves import SECONDS

if TYPE_CHECKING:
    from .problem import RobotJoint

Array = NDArray[np.float64]
TE_OUTPUT = "te_amplitude_arcsec"


def form_of(problem: RobotJoint) -> Form | None:
    """The form; None where a reducer's front is not proven."""
    if not problem.gears.proven:
        return None
    gears = problem.gears.nested
    shared = ["pose_rms_mm", "squareness_mrad", "yaw_mrad", "reversal_mm", "path_te_mm"]
    outputs = [*shared, *(["backlash_rms_arcmin"] * len(gears)), *([TE_OUTPUT] * len(gears))]
    features = [*_of_gears(problem, len(outputs)), *_of_links(problem, len(outputs))]
    offset = np.array([problem.gears.wave.base if name == TE_OUTPUT else 0.0 for name in outputs])
    asked = (*outputs, "cost", *STANDS.values(), *(v.name for v in problem.variables))
    relaxed = tuple(
        limit.name for limit in problem.limits
        if limit.name not in asked
        or (np.isfinite(limit.low) and limit.name not in problem.names)
    )  # fmt: skip
    left_out = f"; limits left out: {', '.join(relaxed)}" if relaxed else ""
    return Form(
        tuple(outputs),
        tuple(features),
        offset,
        _constant(problem, outputs),
        "rms of the position error (first order) and proven fronts of the reducers, phi_2 normal"
        + left_out,
        exact=False,
        relaxed=relaxed,
        stands=STANDS,
    )


def _constant(problem: RobotJoint, outputs: list[str]) -> Array:
    """Squares that no tolerance changes: the hysteresis of drives whose flank is held."""
    mean, lost = problem.machine.squares, 0.25 * problem.gears.hysteresis**2
    found = np.zeros(len(outputs))
    found[0] = lost * float((mean["wave"] - mean["backlash"]).sum())
    found[2] = lost * float((mean["yaw_wave"] - mean["yaw_backlash"]).sum())
    return found


def _of_gears(problem: RobotJoint, rows: int) -> list[Feature]:
    mean, gears = problem.machine.squares, problem.gears
    count = len(gears.nested)
    play, waves = [], []
    for gear, one in enumerate(gears.nested):
        own = [at for at, which in enumerate(problem.gear_of) if which == gear]
        size = {name: float(each[own].sum()) for name, each in mean.items()}
        spread = np.zeros((2, rows))
        spread[0, [0, 2, 3]] = np.sqrt([size["backlash"] / 4.0, size["yaw_backlash"] / 4.0,
                                        size["backlash"]])  # fmt: skip
        spread[0, 5 + gear] = 1.0
        spread[1, [0, 2, 4]] = SECONDS * np.sqrt(
            [size["wave"], size["yaw_wave"], 2.0 * size["wave"]])  # fmt: skip
        spread[1, 5 + count + gear] = gears.wave.least
        nothing = (0.0,) * rows
        low, high = _range(problem, f"reducer_{gear + 1}_{RMS}", one.range)
        ways = tuple(
            Way(curve, max(low, float(curve.t[0])), min(high, float(curve.t[-1])), nothing,
                tuple(spread[0].tolist()), choice=float(grade))
            for curve, grade in zip(one.curves, one.grades, strict=True)
            if max(low, float(curve.t[0])) < min(high, float(curve.t[-1]))
        )  # fmt: skip
        ends = _range(
            problem,
            f"reducer_{gear + 1}_{TE}",
            (float(gears.wave.curve.t[0]), float(gears.wave.curve.t[-1])),
        )
        way = Way(
            gears.wave.curve,
            max(ends[0], float(gears.wave.curve.t[0])),
            min(ends[1], float(gears.wave.curve.t[-1])),
            nothing,
            tuple(spread[1].tolist()),
        )
        times = int(gears.counts[gear])
        choice = f"reducer_{gear + 1}_grade_of_form"
        play.append(Feature(f"reducer_{gear + 1}_{RMS}", ways, choice, times))
        waves.append(Feature(f"reducer_{gear + 1}_{TE}", (way,), "", times))
    return [*play, *waves]


def _of_links(problem: RobotJoint, rows: int) -> list[Feature]:
    squares = problem.machine.links
    found = []
    for at, name in enumerate(problem.link_names):
        spread = np.zeros(rows)
        spread[:3] = np.sqrt(squares[:, at])
        low, high = _range(problem, name, problem.interval(name))
        way = Way(problem.settings.costs[name], low, high, (0.0,) * rows, tuple(spread.tolist()))
        found.append(Feature(name, (way,)))
    return found


def _range(problem: RobotJoint, name: str, usual: tuple[float, float]) -> tuple[float, float]:
    """Range of a variable, limits on it included."""
    low, high = problem.interval(name) if name in problem.names else usual
    for limit in problem.limits:
        if limit.name == name:
            low, high = max(low, limit.low), min(high, limit.high)
    return low, high
