"""What a sheet costs: prices of the requirements, what a budget reaches, single steps of a tolerance.

The requirement counts by its own method: its variation must fit in the room between its middle (the
mean of the units; of a worst case and of shifts the mid-limits) and the nearer limit. A ratio of room to
variation of 1 just keeps the requirement; by `rss` it is Cpk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ...problems.limits import LIMIT_ROUNDING
from ...problems.settings import Bound
from ...problems.stack import Stack
from ...problems.stack.promises import Measured
from ...problems.tolerance_problem import designs_frame
from ...section import Array
from ...units import converted, fits
from ..run.changes import advice, changes
from ..run.choice import ChoiceSettings
from ..run.tolerances import step_of, values_of

LENGTH_STEP_MM, SHARE_STEP = 0.01, 0.01
"""By how much the limits of a requirement move for its price: a length, or else this share of its room."""
RATIOS, RATIOS_OF_LARGE = (0.67, 0.8, 0.9, 1.0, 1.1, 1.2, 1.33, 1.5, 1.67, 2.0), (1.0, 1.33)
"""Ratios at which least costs are solved; of stacks of many parts and requirements."""
LARGE = 60
"""Parts times requirements from which on a stack is large: a single least cost takes some 0.04 s of it."""
ELSEWHERE = "prices and budgets are not on the sheet (no closed form of the least cost, or a promise): see `tolevo run`"
EQUAL_DIGITS = 9
"""Digits to which two ratios are compared, of costs as well."""


@dataclass(frozen=True, slots=True, eq=False)
class SheetCosts:
    """`prices`: per requirement, what each of its limits `step` farther out saves and nearer costs;
    `budgets`: least cost at ratios of room to variation, with its tolerances; `changes`: single steps to
    the next value or process; `advice` which of them to take first. None, or empty, where nothing that is
    searched has a cost, or no requirement has limits.
    """

    prices: pd.DataFrame | None = None
    budgets: pd.DataFrame | None = None
    changes: pd.DataFrame | None = None
    advice: str = ""
    notes: tuple[str, ...] = ()


def costs_of(stack: Stack, design: Array, choice: ChoiceSettings) -> SheetCosts:
    """What the sheet of a stack says of costs at one full design (all variables,)."""
    limited = [measured for measured in stack.measured if measured.mechanism.bounded]
    free = {variable.name for variable in stack.free}
    priced = any(f"{part.name}_t" in free and not part.free_of_charge for part in stack.definition.parts)
    if not limited or not priced or np.any((room := rooms(stack, limited, design[None])[0]) <= 0.0):
        return SheetCosts()
    if stack.promises is not None or any(measured.rough for measured in limited):
        return SheetCosts(notes=(ELSEWHERE,))
    prices, budgets, notes = _least_costs(stack, limited, design, room)
    return SheetCosts(prices, budgets, *_changes(stack, limited, design, room, choice), notes)


def rooms(stack: Stack, limited: list[Measured], designs: Array) -> Array:
    """Distance (n, requirements) from the middle of each requirement to its nearer limit."""
    made, columns = stack.parts_as_made(designs), []
    for measured in limited:
        middle = np.full(len(designs), measured.drawn.centre)
        if measured.requirement.method in ("rss", "monte_carlo"):
            middle = measured.mechanism.centre + measured.linear.mean_shift(made)
        columns.append(np.minimum(measured.mechanism.upper - middle, middle - measured.mechanism.lower))
    return np.stack(columns, axis=1)


def _bounded(stack: Stack, limited: list[Measured], most: Array) -> Stack:
    """The stack with upper limits (requirements,) on variations, and of its own limits those on tolerances."""
    own = {name: bound for name, bound in stack.given.limits.items() if name in stack.names}
    limits = own | {m.name("variation"): Bound(high=float(high)) for m, high in zip(limited, most, strict=True)}
    return Stack(replace(stack.given, limits=limits, objectives=("cost",)))


def _variations(stack: Stack, limited: list[Measured], designs: Array) -> Array:
    """The variation (n, requirements) of each requirement by its method."""
    outputs = stack.needed_outputs(designs)
    return np.stack([outputs[measured.name("variation")] for measured in limited], axis=1)


def _least_costs(
    stack: Stack, limited: list[Measured], design: Array, room: Array
) -> tuple[pd.DataFrame | None, pd.DataFrame | None, tuple[str, ...]]:
    """The tables of prices and budgets, and why they are empty."""
    from ...algorithms.exact.choices import least_cost, search_vectors
    from ...algorithms.exact.solver import closed_form

    problem = _bounded(stack, limited, room)
    form = closed_form(problem)
    outputs = [measured.name("variation") for measured in limited]
    if form is None or list(form.outputs) != outputs:
        return None, None, (ELSEWHERE,)
    steps = np.array([_step(measured, own) for measured, own in zip(limited, room, strict=True)])
    now = float(np.min(room / _variations(problem, limited, design[None])[0]))
    large = len(stack.definition.parts) * len(limited) > LARGE
    ratios = np.array(sorted({*(RATIOS_OF_LARGE if large else RATIOS), *([now] if np.isfinite(now) else [])}))
    nothing = np.zeros((1, len(room)))
    moves = nothing if large else np.concatenate([nothing, np.diag(steps), -np.diag(steps)])
    asked = np.concatenate([room + moves, room / ratios[:, None]])
    optimum = least_cost(form, asked)
    solved = np.isfinite(optimum.cost) & np.all(asked > 0.0, axis=1)
    cost = np.where(solved, optimum.cost, np.nan)
    priced = optimum.multiplier[0] * steps if solved[0] else np.full(len(room), np.nan)
    change = np.round(np.abs(cost[1 : len(moves)] / cost[0] - 1.0), EQUAL_DIGITS) * cost[0]
    wider, narrower = (priced, priced) if large else change.reshape(2, -1)
    prices = pd.DataFrame(
        {
            "requirement": [measured.label for measured in limited],
            "unit": [measured.requirement.unit for measured in limited],
            "step": steps,
            "wider_saves": wider,
            "narrower_costs": narrower,
            "source": "multiplier" if large else "solved again",
        }
    )
    kept = np.flatnonzero(solved[len(moves) :]) + len(moves)
    if not len(kept):
        return prices, None, ("no tolerances in their ranges reach a ratio of room to variation that was asked for",)
    designs = problem.complete(search_vectors(problem, form, optimum.at(kept)))
    budgets = pd.DataFrame({"cost": problem.cost_of(designs)}).join(
        _weakest(limited, rooms(problem, limited, designs) / _variations(problem, limited, designs))
    )
    table = pd.concat([budgets, designs_frame(problem, designs)], axis=1)
    return prices, table.drop_duplicates("cost").sort_values("cost", ignore_index=True), ()


def _weakest(limited: list[Measured], ratios: Array) -> pd.DataFrame:
    """The least of the ratios (n, requirements) of designs, and the first requirement that has it."""
    first = np.round(ratios, EQUAL_DIGITS).argmin(axis=1)
    return pd.DataFrame({"room_over_variation": ratios.min(axis=1), "weakest": [limited[at].label for at in first]})


def _step(measured: Measured, room: float) -> float:
    """By how much each limit moves for a price, in the unit of the requirement."""
    unit = measured.requirement.unit
    if unit and fits(unit, "mm"):
        return float(f"{float(converted(LENGTH_STEP_MM, 'mm', unit)):.6g}")
    return float(f"{SHARE_STEP * room:.1g}")


def _changes(
    stack: Stack, limited: list[Measured], design: Array, room: Array, choice: ChoiceSettings
) -> tuple[pd.DataFrame | None, str]:
    """Every tolerance moved to the next value on either side, or to another process, all others kept, and
    which step to take first.

    A step breaks a requirement whose ratio falls below 1, or below what it is now where that is less.
    """
    present = _variations(_bounded(stack, limited, room), limited, design[None])[0]
    problem = _bounded(stack, limited, np.maximum(room, present))
    steps = {v.name: step_of(problem, v, choice) for v in problem.free}
    values = {v.name: values_of(problem, v, step) for v in problem.free if (step := steps[v.name]) is not None}
    tried = changes(problem, {0: design}, values)
    if tried.empty:
        return None, ""
    change = tried[[f"change_{measured.name('variation')}" for measured in limited]].to_numpy(dtype=float)
    ratios = room / (present + change)
    table = tried[["variable", "to", "value", "cost_change"]].reset_index(drop=True)
    table = table.join(_weakest(limited, ratios)).assign(breaks=tried["broken"].to_numpy())
    beyond = [limited[at].label for at in np.flatnonzero(present > room * (1.0 + LIMIT_ROUNDING))]
    if beyond:
        return table, f"Loosen nothing yet: the ratio of room to variation of {', '.join(beyond)} is below 1."
    return table, advice(problem, tried, {"cost": float(problem.cost_of(design[None])[0])})
