"""What changing one tolerance alone does to a chosen allocation: tried by the full model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from ...arrays import Array
from ...declarations import Kind, Variable
from ...problems.interfaces import Accuracy, Drawing
from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem
from ...units import drawing_number, plain_number, split_unit
from .ranking import BATCH
from .rule import COST

SAME = 1e-9
"""Relative difference below which two values count as equal."""
NAMED = 8
"""Steps that a sentence names at most."""
FEW, MOST = 8, 100
"""Steps of a point that are tried at least, and at most."""
VALUES, IN_ALL = 4000, 20_000
"""Values of variables in the designs that are tried at most: of a point, and of all points."""

Step = tuple[Variable, str, float, Array]
"""The variable of a tolerance, its new value in words, that value, and the full design (all,)."""


def changes(
    problem: ToleranceProblem, designs: Mapping[int, Array], values: Mapping[str, Mapping[float, str]]
) -> pd.DataFrame:
    """Every tolerance of chosen points moved to the next value on either side, all others kept.

    `designs` are the full designs (all variables,) by the row of the front, `values` what can be
    ordered of a variable, with the name of its grade. Choices are moved to every other process, or
    to the next grade. Columns: `point`, `variable`, `to` (in words), `value`, `cost_change`,
    `change_<name>` of every other objective and limited output, `breaks` (the limits that the
    changed design breaks by the full model, separated by spaces), `broken` (with their values) and
    `untried` (steps of the point that were too many to be tried: those that save least). A point
    for which none is left of the budget has no row.
    """
    whole, size = Accuracy.of(problem).reported(), len(problem.variables)
    rows: list[dict[str, Any]] = []
    used = 0
    for point, design in designs.items():
        every = list(_steps(problem, design, values))
        steps = _few(problem, every, int(np.clip(VALUES // size, FEW, MOST)))
        used += len(steps) * size
        if rows and used > IN_ALL:
            break
        tried = np.stack([design, *(step[3] for step in steps)])
        outputs = _evaluated(whole, tried)
        cost = outputs.get(COST, np.zeros(len(tried)))
        names = [n for n in dict.fromkeys((*problem.objectives, *_limited(problem))) if n != COST]
        moved = {name: column - column[0] for name in names for column in (whole.values(tried, outputs, name),)}
        for at, (variable, to, value, _) in enumerate(steps, start=1):
            broken = _broken(whole, tried[at : at + 1], {name: column[at : at + 1] for name, column in outputs.items()})
            rows.append(
                {"point": point, "variable": variable.name, "to": to, "value": value}
                | {"cost_change": cost[at] - cost[0]}
                | {f"change_{name}": column[at] for name, column in moved.items()}
                | {"breaks": " ".join(broken), "broken": "; ".join(broken.values())}
                | {"untried": len(every) - len(steps)}
            )
    return pd.DataFrame(rows) if rows else pd.DataFrame({"point": [], "cost_change": [], "breaks": []})


def _few(problem: ToleranceProblem, steps: list[Step], most: int) -> list[Step]:
    """At most so many steps, those that save most."""
    if len(steps) <= most:
        return steps
    order = np.argsort(problem.cost_of(np.stack([step[3] for step in steps])), kind="stable")[:most]
    return [steps[at] for at in np.sort(order)]


def _limited(problem: ToleranceProblem) -> list[str]:
    return [limit.name for limit in problem.limits if limit.count]


def _evaluated(problem: ToleranceProblem, designs: Array) -> dict[str, Array]:
    """The outputs that are asked for of full designs, a batch at a time."""
    parts = [Accuracy.of(problem).needed(designs[at : at + BATCH]) for at in range(0, len(designs), BATCH)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _broken(problem: ToleranceProblem, design: Array, outputs: Mapping[str, Array]) -> dict[str, str]:
    """The limits that a full design (1, all) breaks, and by which values."""
    broken = {}
    for limit in problem.limits:
        value = problem.values(design, outputs, limit.name)
        if not limit.kept(value)[0]:
            broken[limit.name] = f"{words(limit.name)} {against(float(value[0]), limit)}"
    return broken


def against(value: float, limit: Limit) -> str:
    """Like "0.1783 instead of at most 0.17 mm", with as many digits as show the difference."""
    if np.isnan(value):
        return "has no value"
    end, side = (limit.low, "least") if value < limit.low else (limit.high, "most")
    bound, digits = drawing_number(end), 4
    while digits < 12 and f"{value:.{digits}g}" == f"{end:.{digits}g}":
        digits += 1
    return f"{value:.{digits}g} instead of at {side} {bound} {limit.unit}".rstrip()


def words(name: str) -> str:
    """A column as words, without its unit."""
    return split_unit(name)[0].replace("_", " ").replace(".", " ")


def label_of(name: str) -> str:
    """A tolerance, or the choice of its process, as words: `hub_t` is hub."""
    return words(split_unit(name)[0].removesuffix("_t").removesuffix("_process"))


# ---------------------------------------------------------------- the steps


def _steps(problem: ToleranceProblem, design: Array, values: Mapping[str, Mapping[float, str]]) -> Iterator[Step]:
    """The next values of every free tolerance of a full design (all,), and its other processes."""
    names = problem.names
    for variable in problem.free:
        own = float(design[names.index(variable.name)])
        if variable.labels:
            yield from _processes(problem, variable, design, round(own))
        elif variable.kind is Kind.GRADE:
            low, high = problem.interval(variable.name)
            near = [value for value in (own - 1.0, own + 1.0) if low <= value <= high]
            yield from (
                (variable, f"grade {value:g}", value, _moved(problem, design, variable, value)) for value in near
            )
        elif variable.tolerance and not variable.integer:
            for value, grade in _next(problem, variable, design, values.get(variable.name, {})):
                to = grade or f"{drawing_number(value)} {variable.unit}".rstrip()
                yield variable, to, value, _moved(problem, design, variable, value)


def _next(
    problem: ToleranceProblem, variable: Variable, design: Array, values: Mapping[float, str]
) -> list[tuple[float, str]]:
    """The orderable values below and above that of a design, in the room that it has."""
    low, high = Drawing.of(problem).room(variable.name, design)
    own = float(design[problem.names.index(variable.name)])
    within = [value for value in values if low * (1.0 - SAME) <= value <= high * (1.0 + SAME)]
    below = max((value for value in within if value < own * (1.0 - SAME)), default=None)
    above = min((value for value in within if value > own * (1.0 + SAME)), default=None)
    return [(min(max(value, low), high), values[value]) for value in (below, above) if value is not None]


def _processes(problem: ToleranceProblem, variable: Variable, design: Array, own: int) -> list[Step]:
    """The other processes of a part; of grades to choose from, the next on either side."""
    others = [
        (variable, label, float(number), _moved(problem, design, variable, float(number)))
        for number, label in enumerate(variable.labels)
        if number != own and problem.interval(variable.name)[0] <= number <= problem.interval(variable.name)[1]
    ]
    tolerance = f"{variable.name.removesuffix('_process')}_t"
    if tolerance not in problem.names:
        return others
    at = problem.names.index(tolerance)
    rooms = [Drawing.of(problem).room(tolerance, step[3]) for step in others] if _is_free(problem, tolerance) else []
    if not rooms or any(low < high for low, high in rooms):
        return others
    others.sort(key=lambda step: step[3][at])
    tighter = [step for step in others if step[3][at] < design[at]]
    return tighter[-1:] + [step for step in others if step[3][at] >= design[at]][:1]


def _is_free(problem: ToleranceProblem, name: str) -> bool:
    return any(variable.name == name for variable in problem.free)


def _moved(problem: ToleranceProblem, design: Array, variable: Variable, value: float) -> Array:
    """The full design with another value, in the room that a chosen process leaves."""
    moved = design.copy()
    moved[problem.names.index(variable.name)] = value
    free = [problem.names.index(v.name) for v in problem.free]
    return np.asarray(problem.complete(moved[None, free])[0])


# ---------------------------------------------------------------- in sentences


def advice(problem: ToleranceProblem, tried: pd.DataFrame, design_values: Mapping[Any, Any]) -> str:
    """Which tolerance of a point to loosen first, by its `changes`, or which limit forbids each.

    `design_values` are the objectives of the point, as far as it has them.
    """
    currency = problem.settings.money.currency
    others = [name for name in problem.objectives if name != COST]
    size = max(abs(float(design_values.get(COST, 0.0))), 1e-300)
    saving = tried[tried["cost_change"] < -SAME * size]
    if saving.empty:
        return "No step of one tolerance by itself to the next value that can be ordered saves anything."
    kept = saving[saving["breaks"] == ""]
    if kept.empty:
        untried = int(tried["untried"].iloc[0])
        which = f"each of the {len(saving)} steps that save most" if untried else "every step"
        return f"No tolerance can be loosened by itself: {which} breaks a limit ({_listed(saving)})."
    worse = [kept[f"change_{name}"].to_numpy(dtype=float) / (abs(design_values[name]) or 1.0) for name in others]
    loss = np.max([np.zeros(len(kept)), *worse], axis=0)
    rate = -kept["cost_change"].to_numpy(dtype=float) / size / np.maximum(loss, SAME)
    best = kept.iloc[int(np.argmax(rate))].to_dict()
    units = {o.name: o.unit for o in problem.outputs}
    text = f"Loosen first: {step_words(best)}: saves {_money(-float(best['cost_change']), currency)}"
    for name in others:
        change, unit = float(best[f"change_{name}"]), units.get(name, "")
        direction = "rises" if change > 0.0 else "falls"
        if change:
            text += f"; {words(name)} {direction} by {plain_number(abs(change), 3)} {unit}".rstrip()
    text += "; every limit is kept" if _limited(problem) else ""
    blocked = saving[saving["breaks"] != ""]
    return f"{text}. {_blocked(blocked)}" if len(blocked) else f"{text}."


def _blocked(blocked: pd.DataFrame) -> str:
    return f"Not to be loosened by themselves: {_listed(blocked)}."


def step_words(row: Mapping[Any, Any]) -> str:
    """Like "shaft, to IT11"."""
    return f"{label_of(str(row['variable']))}, to {row['to']}"


def _listed(rows: pd.DataFrame) -> str:
    """The steps, the largest saving first, each with what it breaks."""
    ordered = rows.sort_values("cost_change", kind="stable").to_dict("records")
    named = [f"{step_words(row)}: {row['broken']}" for row in ordered[:NAMED]]
    more = len(ordered) - len(named)
    return "; ".join([*named, f"{more} more break a limit"] if more else named)


def _money(amount: float, currency: str) -> str:
    return f"{plain_number(amount, 3)} {currency}".rstrip()
