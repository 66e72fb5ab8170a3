"""How a part states its tolerance: a range, a fixed value, limits, a grade, a fit, processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...models.costs import CostCurve, Table
from ...models.costs.extras import dearer, read_extras
from ...models.costs.reading import name_of, read_curve
from ...models.inputs import Zone
from ...models.machines.offers import Offer
from ...models.machines.reading import Owner, read_offers
from ...section import POSITIVE, Range, Section
from .definition import Process
from .parts_as_made import processes_of
from .standards import COSTS, MORE, assumed_of, searched_grades, standard

KEYS = ("t_min", "tolerance", "limits", "grade", "fit", "general", "process", "machine")
"""The statements of a zone, by their first key; exactly one is given, except that machines may be
given with processes, and with t_min and t_max, the limits of their inspection."""
MADE = ({"process"}, {"machine"}, {"process", "machine"}, {"t_min", "machine"})
REMEDY = (
    "t_min and t_max with a cost, [[part.process]] or [[part.machine]] tables, or a fixed "
    "tolerance, limits, grade, fit or general tolerance"
)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """A part's zone: its processes, and the mid-limit minus the nominal."""

    processes: tuple[Process, ...]
    fixed: bool = False
    alternatives: bool = False
    mid: float = 0.0
    nominal: float | None = None
    stated: dict[str, Any] = field(default_factory=dict)
    assumed: dict[str, str] = field(default_factory=dict)
    machines: tuple[Offer, ...] = ()


def read_tolerance(section: Section, unit: str, nominal: float | None, fit: str = "") -> Tolerance | None:
    """The zone that the table of a part states, None and faults where it states none.

    `fit` is its tolerance class by a `[[fit]]` of two parts, empty where it is in none.
    """
    given = [key for key in KEYS if key in section or (key == "t_min" and "t_max" in section)]
    section.accept((*KEYS, *MORE, "t_max", "cost"))
    if fit and not given:
        section, given = section.having("fit", fit), ["fit"]
    elif fit:
        section.fault(given[0], f"is a second statement in addition to {fit} of its [[fit]]: keep only one")
        return None
    if set(given) in MADE:
        return _alternatives(section, unit, nominal)
    if len(given) != 1:
        what = f"has too many: {', '.join(given)}; keep only one" if given else "has none"
        section.fault("", f"needs one statement of its tolerance and {what}: {REMEDY}")
        if "cost" in section:
            read_curve(section.section("cost"))
        return None
    if given == ["grade"] and isinstance(section.take("grade"), list):
        grades = searched_grades(section, unit, nominal)
        if grades is None:
            return None
        costs = {key: section.take(key) for key in COSTS if key in section}
        return Tolerance(grades, alternatives=True, stated=stated_of(section) | costs, assumed=assumed_of(grades))
    if given == ["t_min"]:
        process = _process(section, unit)
        return None if process is None else Tolerance((process,))
    fixed = _fixed(section, given[0], unit, nominal)
    curve = _read_cost(section) if "cost" in section else None
    if fixed is None:
        return None
    shape, tolerance = fixed
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
        section.fault(
            "cost", 'is missing: give one, like { model = "reciprocal", a = 1.0, b = 0.1 }, or fix the tolerance'
        )
        curve = None
    else:
        curve = _read_cost(section)
    if low is None or high is None:
        return None
    if low >= high:
        section.fault("t_min", f"must be below t_max ({high:g}), got {low:g}")
        return None
    low, high, note = _narrowed(low, high, curve, unit)
    for key, end in (("t_min", low), ("t_max", high)):
        _check_cost(section, key, curve, end, unit)
    return Process(low, high, curve, name, note=note)


def _narrowed(low: float, high: float, curve: CostCurve | None, unit: str) -> tuple[float, float, str]:
    """A range within the tolerances that a table of costs spans, and a note on it."""
    if not isinstance(curve, Table):
        return low, high, ""
    ends = max(low, curve.t[0]), min(high, curve.t[-1])
    if ends == (low, high) or ends[0] >= ends[1]:
        return low, high, ""
    note = (
        f"costs are given from {curve.t[0]:g} to {curve.t[-1]:g} {unit}: the search from "
        f"{low:g} to {high:g} is narrowed to {ends[0]:g} to {ends[1]:g}"
    )
    return *ends, note


def _read_cost(section: Section) -> CostCurve | None:
    """The cost of a part, including its part of a set-up and its inspection."""
    curve, more = read_curve(section.section("cost")), read_extras(section)
    return None if curve is None else dearer(curve, more)


def _check_cost(section: Section, key: str, curve: CostCurve | None, t: float, unit: str) -> None:
    """Report an end of the range at which the cost is not finite."""
    if curve is None:
        return
    with np.errstate(all="ignore"):
        cost = float(curve.cost(np.array([t]))[0])
    if not math.isfinite(cost):
        section.fault(
            key, f"must have a finite cost, but {t:g} {unit} costs {cost:g} by its cost curve ({name_of(curve)})"
        )


def _alternatives(section: Section, unit: str, nominal: float | None) -> Tolerance | None:
    """The `[[part.process]]` and `[[part.machine]]` tables."""
    if "cost" in section:
        section.fault("cost", "belongs in each [[part.process]]; a machine has a price")
    processes: tuple[Process, ...] | None = ()
    if "process" in section:
        processes = section.named_items("process", lambda table, name: _process(table, unit, name))
    if "machine" not in section:
        return None if processes is None else Tolerance(processes, alternatives=True)
    ends = [section.number(key, unit, POSITIVE) for key in ("t_min", "t_max")]
    offers = read_offers(section, Owner(unit, (ends[0], ends[1]), nominal))
    if processes is None or offers is None:
        return None
    labels = {way.label for offer in offers for way in offer.ways()}
    both = labels & {process.name for process in processes}
    for name in sorted(both):
        section.fault("machine", f'"{name}" is the name of a process and of a machine')
    if both:
        return None
    assumed = "; ".join(offer.assumed for offer in offers if offer.assumed)
    return Tolerance(
        (*processes, *processes_of(offers)),
        alternatives=True,
        machines=offers,
        assumed={"machine": assumed} if assumed else {},
    )


def _fixed(section: Section, key: str, unit: str, nominal: float | None) -> tuple[Zone, dict[str, Any]] | None:
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
        zone, more = standard(section, key, text, unit, nominal)
    except ValueError as error:
        section.fault(key, str(error))
        return None
    return zone, {"stated": stated_of(section) | {key: text}} | more


def stated_of(section: Section) -> dict[str, Any]:
    """The keys of a part's table that state the standard of its zone, as written."""
    keys = ("grade", *(key for key in MORE if key != "geometry"))
    return {key: section.take(key) for key in keys if key in section}


def _limits(text: str) -> Zone:
    zone = Zone.of_text(text)
    if not (math.isfinite(zone.mid) and math.isfinite(zone.half_width)):
        raise ValueError(f'must be finite, got "{text}"')
    return zone
