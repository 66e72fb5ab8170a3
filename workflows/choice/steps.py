"""What can be ordered: the values that a rounded variable may take."""

from __future__ import annotations

import numpy as np

from ...declarations import Kind, Variable
from ...errors import Fault
from ...models.iso286 import GRADES, LARGEST, grade_um
from ...problems.interfaces import Drawing
from ...problems.tolerance_problem import ToleranceProblem
from ...units import converted
from .settings import IT_GRADES, PREFERRED, ChoiceSettings, Step

R20 = (1.0, 1.12, 1.25, 1.4, 1.6, 1.8, 2.0, 2.24, 2.5, 2.8, 3.15, 3.55, 4.0, 4.5, 5.0, 5.6, 6.3, 7.1, 8.0, 9.0)
"""Preferred numbers, basic series R20 (ISO 3:1973)."""
SHARE = 0.01
"""Step of a nominal value by default, at most this fraction of its range."""


def usual_step(problem: ToleranceProblem, variable: Variable) -> Step | None:
    """How a variable is rounded where the configuration does not state it; None: not at all."""
    if variable.integer:
        return None
    if not variable.tolerance:
        low, high = problem.interval(variable.name)
        return _step_below(SHARE * (high - low))
    return IT_GRADES if size_mm(problem, variable) is not None else PREFERRED


def _step_below(most: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(f"{max(f * power for f in (1.0, 2.0, 5.0) if f * power <= most * 1.0001):.6g}")


def size_mm(problem: ToleranceProblem, variable: Variable) -> float | None:
    """Nominal size [mm] that ISO grades can be looked up by, None where there is none."""
    nominal, _ = Drawing.of(problem).zone(variable.name)
    if nominal is None or variable.kind is not Kind.HALF_WIDTH:
        return None
    try:
        size = abs(float(converted(nominal, variable.unit, "mm")))
    except ValueError:
        return None
    return size if 0.0 < size <= LARGEST else None


def half_widths(variable: Variable, size: float) -> dict[str, float]:
    """Half-widths of the ISO 286 grades at a nominal size [mm], in the unit of a variable."""
    widths = {grade: converted(0.5 * grade_um(grade, size), "um", variable.unit) for grade in GRADES}
    return {grade: without_last_digits(float(width)) for grade, width in widths.items()}


def values_of(problem: ToleranceProblem, variable: Variable, step: Step) -> dict[float, str]:
    """Every value of a variable that can be ordered, with the name of its grade or nothing."""
    low, high = problem.interval(variable.name)
    if step == IT_GRADES:
        size = size_mm(problem, variable)
        assert size is not None
        return {half: grade for grade, half in half_widths(variable, size).items()}
    if step == PREFERRED:
        first, last = (int(np.floor(np.log10(end))) for end in (max(low, high * 1e-6), high))
        powers = range(first, last + 1)
        return {without_last_digits(number * 10.0**power): "" for power in powers for number in R20}
    if isinstance(step, tuple):
        return dict.fromkeys(step, "")
    assert isinstance(step, float)
    whole = np.arange(np.floor(low / step), np.ceil(high / step) + 1.0)
    return dict.fromkeys([without_last_digits(n * step) for n in whole.tolist()], "")


def without_last_digits(value: float) -> float:
    """A sum or product without its last digits: 0.30000000000000004 is 0.3."""
    return float(f"{value:.12g}")


def rule_message(problem: ToleranceProblem, variable: Variable, step: Step | None) -> str:
    """The rule of a variable in words."""
    if step is None:
        return "whole numbers as they are" if variable.integer else "as it is"
    if step == IT_GRADES:
        return f"IT grade (ISO 286) at {size_mm(problem, variable):g} mm"
    if step == PREFERRED:
        return f"preferred number R20 (ISO 3) in {variable.unit or 'its unit'}"
    if isinstance(step, tuple):
        return "list: " + ", ".join(f"{value:g}" for value in step)
    return f"multiple of {step:g} {variable.unit}".rstrip()


def step_of(problem: ToleranceProblem, variable: Variable, settings: ChoiceSettings) -> Step | None:
    """How a variable is rounded."""
    stated = settings.steps.get(variable.name)
    return usual_step(problem, variable) if stated is None else stated


def rounding_faults(problem: ToleranceProblem, settings: ChoiceSettings) -> list[Fault]:
    """Grades that are asked for where no nominal size is known, and lists outside of the range."""
    faults, free = [], {v.name: v for v in problem.free}
    for name, step in settings.steps.items():
        place = f"rounding.{name}"
        if name not in free:
            faults.append(Fault(place, "is fixed in this run: there is nothing to round"))
        elif step == IT_GRADES and size_mm(problem, free[name]) is None:
            text = 'has no nominal size of at most 500 mm to look up a grade by: give a step, a list, or "R20"'
            faults.append(Fault(place, text))
        elif isinstance(step, tuple):
            low, high = problem.interval(name)
            if not any(low <= value <= high for value in step):
                faults.append(Fault(place, f"must hold a value between {low:g} and {high:g}"))
    return faults
