"""The chosen allocations as a drawing needs them: zones, limits and grades, before and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ...arrays import Array
from ...declarations import Kind, Variable
from ...problems.interfaces import Comparison, Drawing
from ...problems.tolerance_problem import ToleranceProblem
from ...units import drawing_number
from .notation import MIDDLE, inspection, notation, process_of
from .roughness import SHARE, roughness
from .steps import without_last_digits


def allocation(
    problem: ToleranceProblem,
    choices: Mapping[int, str],
    designs: Mapping[int, tuple[Array, Array]],
    grades: Mapping[str, Mapping[float, str]],
    rules: Mapping[str, str],
    roughness_share: float = SHARE,
) -> pd.DataFrame:
    """A row per chosen point and variable.

    `choices` names the rules that choose a row of the front, `designs` its unrounded and rounded
    full design, `grades` what a value of a variable is called, and `rules` how it is rounded.
    Limits are those of the zone around nominal and mid, deviations where no nominal is known; the
    deviations of a zone are from the nominal. `grade` is the tolerance class where one is stated,
    `symbol` that of a geometrical characteristic. `notation` is what to write on the drawing,
    `process` how the part is made where that is chosen, `roughness_Ra_um` what that implies for the
    surface (at most a `roughness_share` of its zone), `cpk_wanted` the capability that the model
    counts on, and `inspection` what an inspector needs to know of it. Where a problem is one of
    several models, the last column says which.
    """
    rows = []
    models = _models(problem, {point: both[1] for point, both in designs.items()})
    for point, label in choices.items():
        for at, variable in enumerate(problem.variables):
            old, new = (float(design[at]) for design in designs[point])
            name = grades.get(variable.name, {}).get(new, "")
            rows.append(
                {"choice": label, "point": point}
                | _row(problem, variable, old, new, name)
                | {"rounding": rules.get(variable.name, "fixed")}
                | _written(problem, variable, designs[point][1], new, name, roughness_share)
                | models[point]
            )
    table = pd.DataFrame(rows)
    numbers = ("nominal", "mid", "lower_limit", "upper_limit", "lower_deviation", "upper_deviation", "roughness_Ra_um")
    return table.astype(dict.fromkeys(numbers, float))


def _models(problem: ToleranceProblem, rounded: Mapping[int, Array]) -> dict[int, dict[str, str]]:
    """By point: the model by which its rounded design was chosen; empty where there is only one."""
    if not problem.declaration.model_statement:
        return {point: {} for point in rounded}
    labels = Comparison.of(problem).model_labels(np.stack(list(rounded.values())))
    return {point: {"model": label} for point, label in zip(rounded, labels, strict=True)}


def _row(problem: ToleranceProblem, variable: Variable, old: float, new: float, grade: str) -> dict[str, Any]:
    nominal, mid = Drawing.of(problem).zone(variable.name)
    lower, upper = _limits(variable, nominal, mid, new)
    half, drawn = variable.kind is Kind.HALF_WIDTH, Drawing.of(problem).drawn(variable.name)
    if variable.kind is Kind.GRADE:
        grade = f"grade {new:g}"
    return {
        "variable": variable.name,
        "meaning": variable.meaning,
        "kind": str(variable.kind),
        "unit": variable.unit,
        "nominal": nominal,
        "mid": mid if half else None,
        "unrounded": _shown(variable, old),
        "rounded": _shown(variable, new),
        "lower_limit": lower,
        "upper_limit": upper,
        "lower_deviation": without_last_digits(mid - new) if half else None,
        "upper_deviation": without_last_digits(mid + new) if half else None,
        "grade": drawn.get("class", grade),
        "symbol": drawn.get("symbol", ""),
        "drawing": drawn.get("drawing", ""),
        "characteristic": drawn.get("characteristic", ""),
    }


def _written(
    problem: ToleranceProblem, variable: Variable, design: Array, new: float, grade: str, roughness_share: float
) -> dict[str, Any]:
    """What to write on the drawing, and what those who make and inspect the part need to know."""
    drawn = Drawing.of(problem).drawn(variable.name)
    nominal, mid = Drawing.of(problem).zone(variable.name)
    law = problem.settings.variables[variable.name].distribution
    stated = drawn.get("cpk")
    cpk = float(stated) if stated else _capability(law)
    process, half = process_of(problem, variable, design), variable.kind is Kind.HALF_WIDTH
    rough = roughness(process, 2.0 * new, variable.unit, roughness_share) if half else None
    written = notation(variable, nominal, mid, new, drawn.get("class", grade))
    return {
        "notation": written if rough is None else f"{written}; Ra {drawing_number(rough)}",
        "process": process,
        "roughness_Ra_um": rough,
        "cpk_wanted": cpk,
        "inspection": drawn.get("inspection") or inspection(variable, new, cpk, drawn.get("mean", MIDDLE)),
    }


def _capability(law: object) -> float | None:
    """Cp of a normal law; None where none is stated, or the law fills the zone."""
    cp = getattr(law, "cp", None)
    return float(cp) if isinstance(cp, int | float) else None


def _limits(variable: Variable, nominal: float | None, mid: float, t: float) -> tuple[float | None, float | None]:
    if variable.kind is Kind.HALF_WIDTH:
        centre = (nominal or 0.0) + mid
        return without_last_digits(centre - t), without_last_digits(centre + t)
    return (0.0, t) if variable.kind is Kind.FULL_CLEARANCE else (None, None)


def _shown(variable: Variable, value: float) -> float | int | str:
    if variable.labels:
        return variable.labels[int(value)]
    return int(value) if variable.integer else value
