"""How a part states its tolerance: a range, a fixed value, limits, a grade, a fit, processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...models.costs import CostCurve
from ...models.costs.reading import name_of, read_curve
from ...models.inputs import Zone
from ...models.iso286 import UNVERIFIED, Fit, grade_um, zone
from ...section import POSITIVE, Range, Section
from ...units import family
from .definition import Process

KEYS = ("t_min", "tolerance", "limits", "grade", "fit", "process")
"""The ways to state a zone, by their first key; exactly one is given."""
REMEDY = (
    "t_min and t_max with a cost, [[part.process]] tables, or a fixed tolerance, limits, grade or "
    "fit"
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


def read_tolerance(section: Section, unit: str, nominal: float | None) -> Tolerance | None:
    """The zone that the table of a part states, None and faults where it states none."""
    given = [key for key in KEYS if key in section or (key == "t_min" and "t_max" in section)]
    section.known((*KEYS, "t_max", "cost"))
    if len(given) != 1:
        what = f"has too many: {', '.join(given)}; keep one" if given else "has none"
        section.fault("", f"needs one statement of its tolerance and {what}: {REMEDY}")
        if "cost" in section:
            read_curve(section.section("cost"))
        return None
    if given == ["process"]:
        return _alternatives(section, unit)
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
        found, more = _standard(key, text, unit, nominal)
    except ValueError as error:
        section.fault(key, str(error))
        return None
    return found, {"stated": {key: text}} | more


def _limits(text: str) -> Zone:
    found = Zone.of_text(text)
    if not (math.isfinite(found.mid) and math.isfinite(found.half_width)):
        raise ValueError(f'must be finite, got "{text}"')
    return found


def _standard(key: str, text: str, unit: str, nominal: float | None) -> tuple[Zone, dict[str, Any]]:
    """The zone of an ISO 286 grade (symmetric) or fit, in the unit of the part.

    Raises ValueError where the table has none.
    """
    base, factor = family(unit)
    if base != "meter":
        raise ValueError(f"applies to lengths, not to a part in {unit or 'plain numbers'}")
    to_mm = factor / family("mm")[1]
    fit = Fit.of_text(text) if key == "fit" else Fit("JS", text.strip())
    size = fit.size if nominal is None else nominal * to_mm
    if size is None:
        raise ValueError("needs the nominal size of the part: give nominal")
    if fit.size is not None and not math.isclose(fit.size, size, rel_tol=1e-9):
        raise ValueError(f"is for a size of {fit.size:g} mm, but the nominal is {size:g} mm")
    if key == "grade":
        width = grade_um(fit.grade, size) / 1000.0
        found = Zone(0.0, 0.5 * width)
    else:
        found = zone(fit, size)
    unverified = {}
    if fit.grade in UNVERIFIED:
        unverified = {key: f"{fit.grade} of the shipped table has not been verified"}
    nominal = size / to_mm if nominal is None else nominal
    scaled = Zone(found.mid / to_mm, found.half_width / to_mm)
    return scaled, {"nominal": nominal, "assumed": unverified}
