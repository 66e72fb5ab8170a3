"""A tolerance as a drawing states it."""

from __future__ import annotations

from ...declarations import Kind, Variable
from ...problems.tolerance_problem import ToleranceProblem
from ...units import drawing_number


def notation(variable: Variable, nominal: float | None, mid: float, t: float, grade: str = "") -> str:
    """Like "36.05 +0.012/-0.013 mm", "25 ±0.0065 mm (IT6)", "0 to 5 um", "grade 5".

    `nominal` is the nominal size, None where it is not known, `mid` the middle of the zone as a
    deviation from it and t the tolerance, all in the unit of the variable.
    """
    unit = f" {variable.unit}".rstrip()
    more = f" ({grade})" if grade and variable.kind is Kind.HALF_WIDTH else ""
    if variable.labels:
        return variable.labels[int(t)]
    if variable.kind is Kind.GRADE:
        return f"grade {drawing_number(t)}"
    if variable.kind is Kind.FULL_CLEARANCE:
        return f"0 to {drawing_number(t)}{unit}"
    if variable.kind is Kind.STANDARD_DEVIATION:
        return f"standard deviation at most {drawing_number(t)}{unit}"
    if variable.kind is not Kind.HALF_WIDTH:
        return f"{drawing_number(t)}{unit}"
    size = "" if nominal is None else f"{drawing_number(nominal)} "
    zone = f"±{drawing_number(t)}" if mid == 0.0 else f"{_signed(mid + t)}/{_signed(mid - t)}"
    return f"{size}{zone}{unit}{more}"


def _signed(value: float) -> str:
    text = drawing_number(value)
    return f"+{text}" if float(text) > 0.0 else text


def process_of(problem: ToleranceProblem, variable: Variable, design: object) -> str:
    """How the part of a tolerance is made, where a variable of the problem chooses it."""
    name = f"{variable.name.removesuffix('_t')}_process"
    names = problem.names
    if name not in names or name == variable.name:
        return ""
    labels = problem.variables[names.index(name)].labels
    return labels[int(design[names.index(name)])] if labels else ""  # type: ignore[index]


MIDDLE = "mean at mid-limit"


def inspection(variable: Variable, t: float, cpk: float | None, mean: str = MIDDLE) -> str:
    """What the model assumes of the parts, for those who inspect them."""
    unit = f" {variable.unit}".rstrip()
    if variable.kind is Kind.STANDARD_DEVIATION:
        return "standard deviation of a sample of the process, about the nominal value"
    if variable.kind is Kind.HALF_WIDTH and cpk:
        return f"standard deviation at most {t / (3.0 * cpk):.3g}{unit}, {mean}"
    if variable.kind in (Kind.HALF_WIDTH, Kind.FULL_CLEARANCE):
        return "every part within the limits; measuring uncertainty reduces them (ISO 14253-1)"
    return ""
