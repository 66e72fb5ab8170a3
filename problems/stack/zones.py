"""How a part states its tolerance: a range, a fixed value, limits, a grade, a fit, processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...models.costs import CostCurve
from ...models.costs.reading import name_of, read_curve
from ...models.inputs import Zone
from ...section import POSITIVE, Range, Section
from .definition import Process
from .standards import MORE, assumed_of, searched_grades, standard

KEYS = ("t_min", "tolerance", "limits", "grade", "fit", "general", "process")
"""The ways to state a zone, by their first key; exactly one is given."""
REMEDY = (
    "t_min and t_max with a cost, [[part.process]] tables, or a fixed tolerance, limits, grade, "
    "fit or general tolerance"
)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What is known of a part's zone: its processes, and the mid-limit minus the nominal."""

    processes: tuple[Process, ...]
    fixed: bool = False
    alternatives: bool = False
    mid: float = 0.0
    nominal: float | None = None
    stated: dict[str, Any] = field(default_factory=dict)
    assumed: dict[str, str] = field(default_factory=dict)


def read_tolerance(
    section: Section, unit: str, nominal: float | None, fit: str = ""
) -> Tolerance | None:
    """The zone that the table of a part states, None and faults where it states none.

    `fit` is its tolerance class by a `[[fit]]` of two parts, empty where it is in none.
    """
    given = [key for key in KEYS if key in section or (key == "t_min" and "t_max" in section)]
    section.known((*KEYS, *MORE, "t_max", "cost"))
    if fit and not given:
        section, given = section.having("fit", fit), ["fit"]
    elif fit:
        section.fault(given[0], f"is a second statement beside {fit} of its [[fit]]: keep one")
        return None
    if len(given) != 1:
        what = f"has too many: {', '.join(given)}; keep one" if given else "has none"
        section.fault("", f"needs one statement of its tolerance and {what}: {REMEDY}")
        if "cost" in section:
            read_curve(section.section("cost"))
        return None
    if given == ["process"]:
        return _alternatives(section, unit)
    if given == ["grade"] and isinstance(section.take("grade"), list):
        grades = searched_grades(section, unit, nominal)
        if grades is None:
            return None
        return Tolerance(grades, alternatives=True, stated=stated_of(section),
                         assumed=assumed_of(grades))  # fmt: skip
    if given == ["t_min"]:
        process = _process(section, unit)
        return None if process is None else Tolerance((process,))
    found = _fixed(section, given[0], unit, nominal)
    curve = read_curve(section.section("cost")) if "cost" in section else None
    if found is None:
        return None
    shape, tolerance = found
    _check_cost(section, given[0], curve, shape.half_width, unit)
    process = Process(shape.half_width, shape.half_width, curve)
    return Tolerance((process,), True, False, shape.mid, **tolerance)


def _process(section: Section, unit: str, name: str = "") -> Process | None:
    """A range with its cost."""
    low, high = (section.number(key, unit, POSITIVE) for key in ("t_min", "t_max"))
    for key in ("t_min", "t_max"):
        if key not in section:
            section.fault(key, "is missing: a tolerance is searched from t_min to t_max")
    if "cost" not in section:
        section.fault("cost", 'is missing: give one, like { model = "reciprocal", a = 1.0, b = 0.1 '
                      "}, or fix the tolerance")  # fmt: skip
        curve = None
    else:
        curve = read_curve(section.section("cost"))
    if low is None or high is None:
        return None
    if low >= high:
        section.fault("t_min", f"must be below t_max ({high:g}), got {low:g}")
        return None
    for key, end in (("t_min", low), ("t_max", high)):
        _check_cost(section, key, curve, end, unit)
    return Process(low, high, curve, name)


def _check_cost(section: Section, key: str, curve: CostCurve | None, t: float, unit: str) -> None:
    """Report an end of the range at which the cost is not finite."""
    if curve is None:
        return
    with np.errstate(all="ignore"):
        cost = float(curve.cost(np.array([t]))[0])
    if not math.isfinite(cost):
        section.fault(key, f"must have a finite cost, but {t:g} {unit} costs {cost:g} by its cost "
                      f"curve ({name_of(curve)})")  # fmt: skip


def _alternatives(section: Section, unit: str) -> Tolerance | None:
    """The `[[part.process]]` tables."""
    if "cost" in section:
        section.fault("cost", "belongs into each [[part.process]]")
    tables = section.tables("process")
    names: list[str] = []
    found: list[Process | None] = []
    for at in range(len(tables)):
        own = section.item("process", at)
        name = own.text("name")
        if not name:
            own.fault("name", "is missing: name the process")
        elif name in names:
            own.fault("name", f'"{name}" is named twice')
        names.append(name or "")
        found.append(_process(own, unit, name or ""))
        own.finish()
    if not tables and isinstance(section.take("process"), list):
        section.fault("process", "must list at least one process")
    whole = tuple(one for one in found if one is not None)
    if not found or len(whole) < len(found):
        return None
    return Tolerance(whole, alternatives=True)


def _fixed(
    section: Section, key: str, unit: str, nominal: float | None
) -> tuple[Zone, dict[str, Any]] | None:
    """The zone about the nominal that a bought-in part has."""
    if key == "tolerance":
        value = section.number("tolerance", unit, Range(low=0.0))
        return None if value is None else (Zone(0.0, value), {"stated": {"tolerance": value}})
    text = section.text(key)
    if text is None:
        return None
    try:
        if key == "limits":
            return _limits(text), {"stated": {key: text}}
        found, more = standard(section, key, text, unit, nominal)
    except ValueError as error:
        section.fault(key, str(error))
        return None
    return found, {"stated": stated_of(section) | {key: text}} | more


def stated_of(section: Section) -> dict[str, Any]:
    """What the table of a part says about the standard of its zone, as it stands there."""
    keys = ("grade", *(key for key in MORE if key != "geometry"))
    return {key: section.take(key) for key in keys if key in section}


def _limits(text: str) -> Zone:
    found = Zone.of_text(text)
    if not (math.isfinite(found.mid) and math.isfinite(found.half_width)):
        raise ValueError(f'must be finite, got "{text}"')
    return found
