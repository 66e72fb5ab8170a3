"""Tolerances as they go on a drawing: steps, grades, roughness, and the allocation of a point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import Fault
from ...models.cost_reading import curve_table
from ...models.costs import CostCurve, Table
from ...models.iso286 import GRADES, MAX_SIZE_MM, grade_um
from ...problems.cost_columns import COST, costs_by_variable
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Assumption, Kind, Variable
from ...units import NO_ZONE, converted, drawing_number, fits, split_unit, to_unit
from .choice import ALL, IT_GRADES, PREFERRED, R20, ChoiceSettings, Step

if TYPE_CHECKING:
    import pandas as pd

FINER = "finer"
SERIES = {
    PREFERRED: sorted({at / 10 for at in (*range(10, 20), *range(20, 50, 2), *range(25, 50, 5), *range(50, 100, 5))}),
    FINER: sorted({at / 20 for at in (*range(20, 40), *range(40, 100, 2), *range(100, 200, 4), *range(100, 200, 10))}),
    R20: (1.0, 1.12, 1.25, 1.4, 1.6, 1.8, 2.0, 2.24, 2.5, 2.8, 3.15, 3.55, 4.0, 4.5, 5.0, 5.6, 6.3, 7.1, 8.0, 9.0),
}
"""Numbers of a decade: multiples of the largest of 1, 2, 5 times a power of ten that is at most a tenth of the
number, and of some half of that; the same of a twentieth; the basic series R20 of preferred numbers (ISO 3:1973)."""
SHARE, RANGE_SHARE = 0.01, 0.1
"""Step of a nominal value by default, at most this fraction of its range; that of a tolerance, where few numbers of
a series lie in its range."""


def usual_step(problem: ToleranceProblem, variable: Variable) -> Step | None:
    """How a variable is rounded where the configuration does not state it; None: not at all."""
    if variable.integer:
        return None
    if not variable.tolerance:
        low, high = problem.interval(variable.name)
        return _step_below(SHARE * (high - low))
    return PREFERRED


def _step_below(most: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(f"{max(f * power for f in (1.0, 2.0, 5.0) if f * power <= most * 1.0001):.6g}")


def size_mm(problem: ToleranceProblem, variable: Variable) -> float | None:
    """Nominal size [mm] that ISO grades can be looked up by, None where there is none."""
    nominal, _ = problem.zone(variable.name)
    if nominal is None or variable.kind is not Kind.HALF_WIDTH:
        return None
    try:
        size = abs(float(converted(nominal, variable.unit, "mm")))
    except ValueError:
        return None
    return size if 0.0 < size <= MAX_SIZE_MM else None


SIZES = {"pin_hole_radius": "pin_radius"}
"""Sizes of a model by the error of another feature of the same size."""


def nominal_and_mid(problem: ToleranceProblem, variable: Variable) -> tuple[float | None, float]:
    """Nominal size, None where it is not known, and the middle of the zone as a deviation from it, in
    the unit of the variable. Where the parts have none it is a parameter: `pin_radius_mm` of `pin_radius_um`.
    """
    nominal, mid = problem.zone(variable.name)
    error = split_unit(variable.name)[0]
    size = problem.settings.parameters.get(f"{SIZES.get(error, error)}_mm")
    if nominal is None and variable.kind is Kind.HALF_WIDTH and isinstance(size, int | float):
        nominal = round_last_digits(float(converted(float(size), "mm", variable.unit)))
    return nominal, mid


def half_widths(variable: Variable, size: float) -> dict[str, float]:
    """Half-widths of the ISO 286 grades at a nominal size [mm], in the unit of a variable."""
    widths = {grade: converted(0.5 * grade_um(grade, size), "um", variable.unit) for grade in GRADES}
    return {grade: round_last_digits(float(width)) for grade, width in widths.items()}


def values_of(problem: ToleranceProblem, variable: Variable, step: Step) -> dict[float, str]:
    """Every value of a variable that can be ordered, with the name of its grade or nothing."""
    low, high = problem.interval(variable.name)
    if step == IT_GRADES:
        size = size_mm(problem, variable)
        assert size is not None
        return {half: grade for grade, half in half_widths(variable, size).items()}
    if isinstance(step, str):
        return dict.fromkeys(_series(SERIES[step], low, high), "")
    if isinstance(step, tuple):
        return dict.fromkeys(step, "")
    assert isinstance(step, float)
    whole = np.arange(np.floor(low / step), np.ceil(high / step) + 1.0)
    return dict.fromkeys([round_last_digits(n * step) for n in whole.tolist()], "")


def _series(numbers: Sequence[float], low: float, high: float) -> list[float]:
    """Numbers of a series in every decade of a range, with the ends of the range that have three
    digits at most; multiples of a tenth of the range as well, where it holds few of them.
    """
    first, last = (int(np.floor(np.log10(end))) for end in (max(low, high * 1e-6), high))
    values = {round_last_digits(number * 10.0**power) for power in range(first, last + 1) for number in numbers}
    values |= {end for end in (low, high) if end > 0.0 and float(f"{end:.3g}") == end}
    if high > low and sum(low <= value <= high for value in values) < 1.0 / RANGE_SHARE:
        step = _step_below(RANGE_SHARE * (high - low))
        values |= {round_last_digits(n * step) for n in range(int(low / step) + 1, int(high / step) + 1)}
    return sorted(values)


def round_last_digits(value: float) -> float:
    """A sum or product without its last digits: 0.30000000000000004 is 0.3."""
    return float(f"{value:.12g}")


def rule_message(problem: ToleranceProblem, variable: Variable, step: Step | None) -> str:
    """The rule of a variable in words."""
    if step is None:
        return "whole numbers as they are" if variable.integer else "as it is"
    if step == IT_GRADES:
        return f"IT grade (ISO 286) at {size_mm(problem, variable):g} mm"
    if isinstance(step, str):
        kind = "preferred number R20 (ISO 3)" if step == R20 else "multiple of 1, 2 or 5 units of a digit"
        more = "" if step == R20 else ": a tenth of it at most, a twentieth where that saves more than 1 %"
        return f"{kind} in {variable.unit or 'its unit'}{more}"
    if isinstance(step, tuple):
        return "list: " + ", ".join(f"{value:g}" for value in step)
    return f"multiple of {step:g} {variable.unit}".rstrip()


def step_of(problem: ToleranceProblem, variable: Variable, settings: ChoiceSettings) -> Step | None:
    """How a variable is rounded: as stated of it, else of all tolerances, else as usual. Grades that are stated of
    all are those of the tolerances of a known nominal size.
    """
    stated = settings.steps.get(variable.name)
    general = settings.steps.get(ALL) if variable.tolerance and not variable.integer else None
    if stated is not None or general is None:
        return usual_step(problem, variable) if stated is None else stated
    return PREFERRED if general == IT_GRADES and size_mm(problem, variable) is None else general


def rounding_faults(problem: ToleranceProblem, settings: ChoiceSettings) -> list[Fault]:
    """Grades that are asked for where no nominal size is known, and values or steps outside of the range."""
    faults, free = [], {v.name: v for v in problem.free}
    for name, step in settings.steps.items():
        place = f"rounding.{name}"
        concerned = [v for v in free.values() if v.tolerance and not v.integer and v.name not in settings.steps]
        if name != ALL and name not in free:
            faults.append(Fault(place, "is fixed in this run: there is nothing to round"))
            continue
        concerned = concerned if name == ALL else [free[name]]
        if step == IT_GRADES and concerned and all(size_mm(problem, v) is None for v in concerned):
            text = 'has no nominal size of at most 500 mm to look up a grade by: give a step, a list, or "preferred"'
            faults.append(Fault(place, text if name != ALL else f"no tolerance {text}"))
    ends = {name: (problem.settings.variables[name].low, problem.settings.variables[name].high) for name in free}
    ranges = {name: (low, high) for name, (low, high) in ends.items() if low is not None and high is not None}
    return [*faults, *coarse_steps(ranges, problem.variables, settings)]


def coarse_steps(
    ranges: Mapping[str, tuple[float, float]], variables: Sequence[Variable], settings: ChoiceSettings
) -> list[Fault]:
    """Lists and steps of which no value lies in the range of a variable, by the ranges of those searched."""
    faults = []
    for name, step in settings.steps.items():
        if isinstance(step, str):
            continue
        others = [v.name for v in variables if v.tolerance and not v.integer and v.name not in settings.steps]
        for own in others if name == ALL else [name]:
            low, high = ranges.get(own, (0.0, np.inf))
            if np.isinf(high):
                continue
            values = step if isinstance(step, tuple) else (np.floor(high * (1.0 + 1e-9) / step) * step,)
            if not any(low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9) for value in values):
                which = f" for {own}" if name == ALL else ""
                kind = "hold a value" if isinstance(step, tuple) else "have a multiple"
                text = f"must {kind} between {low:g} and {high:g}{which}: state finer ones"
                faults.append(Fault(f"rounding.{name}", text))
    return faults


# A tolerance as a drawing states it.


def notation(
    variable: Variable, nominal: float | None, mid: float, t: float, grade: str = "", drawn_as: str = ""
) -> str:
    """Like "36.05 +0.012/-0.013 mm", "⌀25 ±0.0065 mm (IT6)", "-3 to 1 um" where no nominal size is known,
    "R3 0/-0.002 mm (⌀6 0/-0.004 mm)", "0 to 5 um", "±1.5 mrad (±309.4″)", "±1.5 mrad (±309.4″, ±2 um at R1.3 mm)"
    of an angle that is drawn "at 1.3 mm", "⌖ ⌀0.3 mm" of a feature, a dash of one without a zone, "grade 5".
    None begins with + or a hyphen (minus sign and dash are other characters), which a spreadsheet would compute.

    `nominal` is the nominal size, None where it is not known, `mid` the middle of the zone as a
    deviation from it and t the tolerance, all in the unit of the variable.
    """
    unit = f" {variable.unit}".rstrip()
    if is_feature(drawn_as):  # t is half of its zone, which is 0 where t is in units of a bonus
        zone, unit = (2e-3 * t, " mm") if variable.unit == "um" else (2.0 * t if unit else 0.0, unit)
        return drawn_as.format(f"{drawing_number(zone)}{unit}")
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
        angle = f" ({_minus(_seconds(t, variable.unit))}″)" if _is_small_angle(variable) else ""
        return f"{_minus(t)}{unit}{angle}"
    if nominal is not None and variable.unit == "um":  # drawings have sizes and deviations in one unit
        nominal, mid, t, unit = 1e-3 * nominal, 1e-3 * mid, 1e-3 * t, " mm"
    if nominal is None and mid != 0.0:
        return f"{_minus(mid - t)} to {_minus(mid + t)}{unit}{more}"
    if nominal is not None and (drawn_as == "radius" or ("_radius" in variable.name and variable.unit == "um")):
        return f"R{_zone(nominal, mid, t)}{unit} (⌀{_zone(2.0 * nominal, 2.0 * mid, 2.0 * t)}{unit})"
    angles = [f"±{drawing_number(_seconds(t, variable.unit))}″"] if _is_small_angle(variable) else []
    if drawn_as.startswith("at "):
        radius = float(to_unit(drawn_as.removeprefix("at "), "mm"))
        length = 1e3 * radius * float(converted(t, variable.unit, "rad"))
        angles.append(f"±{float(f'{length:.4g}'):g} um at R{drawing_number(radius)} mm")
    angle = f" ({', '.join(angles)})" if angles else ""
    return f"{'⌀' if drawn_as == 'diameter' else ''}{_zone(nominal, mid, t)}{unit}{more}{angle}"


def is_feature(drawn_as: str) -> bool:
    """Whether a drawing states the zone of a feature, which has no limits, or that it has none."""
    return "{}" in drawn_as or drawn_as == NO_ZONE


def _zone(nominal: float | None, mid: float, t: float) -> str:
    size = "" if nominal is None else f"{drawing_number(nominal)} "
    return size + (f"±{drawing_number(t)}" if mid == 0.0 else f"{_signed_number(mid + t)}/{_signed_number(mid - t)}")


def _seconds(value: float, unit: str) -> float:
    """An angle in arc seconds, with four digits."""
    return float(f"{float(converted(value, unit, 'arcsec')):.4g}")


def _is_small_angle(variable: Variable) -> bool:
    """Whether its unit is one of angles that drawings do not have: they have degrees, minutes and seconds."""
    return variable.unit in ("arcmin", "rad", "mrad", "urad")


def _minus(value: float) -> str:
    """A number with a minus sign that starts no formula."""
    return drawing_number(value).replace("-", "\N{MINUS SIGN}", 1)


def _signed_number(value: float) -> str:
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


# What a drawing and a price need to know of every variable: `tolerances.json`.


def tolerances(
    problem: ToleranceProblem, rules: Mapping[str, str], values: Mapping[str, Mapping[float, str]]
) -> tuple[dict[str, Any], ...]:
    """A record per variable: what it is, its range, what can be ordered, what it costs.

    `rules` say how a variable is rounded, `values` what can be ordered of it with the names of
    grades. Each of several alternative processes has a range and a cost curve, in the order of the
    labels of its variable.
    """
    free = {v.name for v in problem.free}
    return tuple(
        _record(problem, v, v.name in free, rules.get(v.name, "fixed"), values.get(v.name, {}))
        for v in problem.variables
    )


def _record(
    problem: ToleranceProblem, v: Variable, free: bool, rule: str, values: Mapping[float, str]
) -> dict[str, Any]:
    nominal, mid = nominal_and_mid(problem, v)
    low, high = problem.interval(v.name) if free else (problem.fixed[v.name],) * 2
    return {
        "name": v.name,
        "unit": v.unit,
        "meaning": v.meaning,
        "kind": v.kind.name.lower(),
        "free": free,
        "integer": v.integer,
        "labels": list(v.labels),
        "low": low,
        "high": high,
        "nominal": nominal,
        "mid": mid if v.kind is Kind.HALF_WIDTH else None,
        "um": _um(v) if v.tolerance else None,
        "rule": rule,
        "orderable": [
            [value, name] for value, name in sorted(values.items()) if low * (1 - 1e-9) <= value <= high * (1 + 1e-9)
        ],
        "grades": grades_of(problem, v),
        "process": f"{v.name.removesuffix('_t')}_process",
        "costs": [_cost_curve(curve) | {"count": count} for curve, count in problem.curves_of(v.name)],
        **problem.drawn(v.name),
    }


def _cost_curve(curve: CostCurve) -> dict[str, Any]:
    """A curve as a page computes with it; a table also has the least cost up to each entry."""
    table = curve_table(curve)
    return table | {"cost_at": list(curve.least)} if isinstance(curve, Table) else table


def _um(v: Variable) -> float | None:
    """One micrometre in the unit of a variable; None where that is no length."""
    try:
        return float(converted(1.0, "um", v.unit)) if v.unit else None
    except ValueError:
        return None


def grades_of(problem: ToleranceProblem, v: Variable) -> list[list[Any]]:
    """ISO 286 grades with their half-widths in the unit of a variable of known nominal size."""
    size = size_mm(problem, v)
    return [] if size is None else [[grade, half] for grade, half in half_widths(v, size).items()]


# The roughness that a tolerance and the process behind its cost curve ask for.


PREFERRED_ROUGHNESS = (0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.3, 12.5, 25.0)
"""Preferred values of Ra [um], ISO 21920-1."""
USUAL: Mapping[str, tuple[float, float]] = {
    "superfinish": (0.05, 0.2),
    "lapp": (0.05, 0.4),
    "polish": (0.1, 0.4),
    "hon": (0.1, 0.8),
    "ground": (0.1, 1.6),
    "grind": (0.1, 1.6),
    "turn": (0.4, 6.3),
    "bor": (0.4, 6.3),
    "ream": (0.8, 3.2),
    "broach": (0.8, 3.2),
    "mill": (0.8, 6.3),
    "drill": (1.6, 6.3),
    "plan": (1.6, 12.5),
    "saw": (1.6, 25.0),
}
"""Ra [um] that a process usually reaches, by how its name begins (ASME B46.1, appendix B)."""
SHARE_OF_TOLERANCE = 1.0 / 20.0
"""Ra as a fraction of the width of the zone at most: peaks, some five times Ra, take a quarter."""
WHY = "Ra is at most this fraction of the width of a zone: peaks, some five times Ra, take a quarter"


def share_of(settings: ChoiceSettings) -> float:
    """The most that Ra may be of the width of a zone."""
    return SHARE_OF_TOLERANCE if settings.roughness_share is None else settings.roughness_share


def roughness_assumptions(problem: ToleranceProblem, settings: ChoiceSettings) -> tuple[Assumption, ...]:
    """The assumption behind a roughness, where a process of the problem implies one."""
    names = [label for v in problem.variables if v.name.endswith("_process") for label in v.labels]
    if not any(_usual_roughness(name) for name in names):
        return ()
    set_by = "default" if settings.roughness_share is None else "configuration"
    reason = WHY if settings.roughness_share is None else WHY.split(":")[0]
    return (Assumption("choice.roughness_share", share_of(settings), "", reason, set_by),)


def roughness(process: str, width: float, unit: str, largest_share: float = SHARE_OF_TOLERANCE) -> float | None:
    """The largest preferred Ra [um] that a zone of a `width` takes, at most a `largest_share` of it
    and within what the process of its cost curve usually reaches; None where the process is not
    known by name, or it is no length.
    """
    usual = _usual_roughness(process)
    if usual is None or not unit or not fits(unit, "um"):
        return None
    finest, coarsest = usual
    most = min(coarsest, largest_share * float(converted(width, unit, "um")))
    return max((ra for ra in PREFERRED_ROUGHNESS if finest <= ra <= most * (1.0 + 1e-9)), default=finest)


def _usual_roughness(process: str) -> tuple[float, float] | None:
    """Ra [um] that a process usually reaches; None where it is not known by name."""
    return next((ra for stem, ra in USUAL.items() if process.lower().startswith(stem)), None)


# The chosen allocations as a drawing needs them: zones, limits and grades, before and after.


def allocation(
    problem: ToleranceProblem,
    choices: Mapping[int, str],
    designs: Mapping[int, tuple[Array, Array]],
    grades: Mapping[str, Mapping[float, str]],
    rules: Mapping[str, str],
    roughness_share: float = SHARE_OF_TOLERANCE,
) -> pd.DataFrame:
    """A row per chosen point and variable.

    `choices` names the rules that choose a row of the front, `designs` its unrounded and rounded
    full design, `grades` what a value of a variable is called, and `rules` how it is rounded.
    Limits are those of the zone around nominal and mid, deviations where no nominal is known; the
    deviations of a zone are from the nominal; features have neither. `grade` is the tolerance class where
    one is stated, `symbol` that of a geometrical characteristic. `notation` is what to write on the
    drawing, `process` how the part is made where that is chosen, `roughness_Ra_um` what that implies for the
    surface (at most a `roughness_share` of its zone), `cpk_wanted` the capability that the model
    counts on, and `inspection` what an inspector needs to know of it. Where there are further costs, a column
    of each, the first one included, has what the variable costs as rounded. Where a problem is one of
    several models, the last column says which.
    """
    import pandas as pd

    rows = []
    costs = {point: _costs(problem, both[1]) for point, both in designs.items()}
    models = _models(problem, {point: both[1] for point, both in designs.items()})
    for point, label in choices.items():
        for at, variable in enumerate(problem.variables):
            old, new = (float(design[at]) for design in designs[point])
            name = grades.get(variable.name, {}).get(new, "")
            rows.append(
                {"choice": label, "point": point}
                | _row(problem, variable, old, new, name)
                | {"rounding": rules.get(variable.name, "fixed")}
                | _drawing_notes(problem, variable, designs[point][1], new, name, roughness_share)
                | {column: each.get(variable.name, np.nan) for column, each in costs[point].items()}
                | models[point]
            )
    table = pd.DataFrame(rows)
    numbers = ("nominal", "mid", "lower_limit", "upper_limit", "lower_deviation", "upper_deviation", "roughness_Ra_um")
    return table.astype(dict.fromkeys(numbers, float))


def _costs(problem: ToleranceProblem, rounded: Array) -> dict[str, dict[str, float]]:
    """By column of costs and variable: what it costs at a full design; empty where the cost is the only one."""
    if not problem.settings.cost_columns:
        return {}
    by_column = {COST: problem.costs_of(rounded[None])} | costs_by_variable(problem, rounded[None])
    return {name: {variable: float(cost[0]) for variable, cost in each.items()} for name, each in by_column.items()}


def _models(problem: ToleranceProblem, rounded: Mapping[int, Array]) -> dict[int, dict[str, str]]:
    """By point: the model by which its rounded design was chosen; empty where there is only one."""
    if not problem.declaration.model_statement:
        return {point: {} for point in rounded}
    labels = problem.model_labels(np.stack(list(rounded.values())))
    return {point: {"model": label} for point, label in zip(rounded, labels, strict=True)}


def _row(problem: ToleranceProblem, variable: Variable, old: float, new: float, grade: str) -> dict[str, Any]:
    nominal, mid = nominal_and_mid(problem, variable)
    drawn = problem.drawn(variable.name)
    feature = is_feature(drawn.get("drawn_as", ""))
    lower, upper = (None, None) if feature else _limits(variable, nominal, mid, new)
    half = variable.kind is Kind.HALF_WIDTH and not feature
    if variable.kind is Kind.GRADE:
        grade = f"grade {new:g}"
    return {
        "variable": variable.name,
        "meaning": variable.meaning,
        "kind": str(variable.kind),
        "unit": variable.unit,
        "nominal": nominal,
        "mid": mid if half else None,
        "unrounded": _design_value(variable, old),
        "rounded": _design_value(variable, new),
        "lower_limit": lower,
        "upper_limit": upper,
        "lower_deviation": round_last_digits(mid - new) if half else None,
        "upper_deviation": round_last_digits(mid + new) if half else None,
        "grade": drawn.get("class", grade),
        "symbol": drawn.get("symbol", ""),
        "drawing": drawn.get("drawing", ""),
        "characteristic": drawn.get("characteristic", ""),
        "source": drawn.get("source", ""),
    }


def _drawing_notes(
    problem: ToleranceProblem, variable: Variable, design: Array, new: float, grade: str, roughness_share: float
) -> dict[str, Any]:
    """What to write on the drawing, and what those who make and inspect the part need to know."""
    drawn = problem.drawn(variable.name)
    nominal, mid = nominal_and_mid(problem, variable)
    law = problem.settings.variables[variable.name].distribution
    stated, mean = drawn.get("cpk"), drawn.get("mean", MIDDLE)
    cpk = float(stated) if stated else _capability(law)
    process, half = process_of(problem, variable, design), variable.kind is Kind.HALF_WIDTH
    rough = roughness(process, 2.0 * new, variable.unit, roughness_share) if half else None
    written = notation(variable, nominal, mid, new, drawn.get("class", grade), drawn.get("drawn_as", ""))
    return {
        "notation": written if rough is None else f"{written}; Ra {drawing_number(rough)}",
        "process": process,
        "roughness_Ra_um": rough,
        "cpk_wanted": cpk,
        "inspection": "" if written == NO_ZONE else drawn.get("inspection") or inspection(variable, new, cpk, mean),
    }


def _capability(law: object) -> float | None:
    """Cp of a normal law; None where none is stated, or the law fills the zone."""
    cp = getattr(law, "cp", None)
    return float(cp) if isinstance(cp, int | float) else None


def _limits(variable: Variable, nominal: float | None, mid: float, t: float) -> tuple[float | None, float | None]:
    if variable.kind is Kind.HALF_WIDTH:
        centre = (nominal or 0.0) + mid
        return round_last_digits(centre - t), round_last_digits(centre + t)
    return (0.0, t) if variable.kind is Kind.FULL_CLEARANCE else (None, None)


def _design_value(variable: Variable, value: float) -> float | int | str:
    if variable.labels:
        return variable.labels[int(value)]
    return int(value) if variable.integer else value
