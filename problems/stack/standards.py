"""Zones of parts by standards: grades and fits (ISO 286), general tolerances (ISO 2768)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from ...errors import nearest
from ...models.costs.extras import dearer, read_extras_by
from ...models.costs.reading import read_curve
from ...models.costs.reciprocal import Reciprocal
from ...models.inputs import Zone
from ...models.iso286 import GRADES, SYMBOLS, UNVERIFIED, Fit, angle_rad, geometrical_mm, grade_um, linear_mm, zone
from ...section import Range, Section
from ...units import family
from .definition import Process

MORE = ("geometry", "price", "feature", "leg")
"""Keys other than that of the zone: prices of grades, the geometrical characteristic of ISO 1101,
and what a general tolerance is of.
"""
COSTS = ("cost", "setup", "inspection")
"""Keys for costs of grades other than their prices."""
FEATURES = ("length", "radius")


def standard(section: Section, key: str, text: str, unit: str, nominal: float | None) -> tuple[Zone, dict[str, Any]]:
    """The zone of an ISO 286 grade (symmetric) or fit, or of a general tolerance of ISO 2768, in
    the unit of the part, with its nominal and what is assumed.

    Raises ValueError where the table has none.
    """
    if key == "general":
        return Zone(0.0, _general(section, text, unit, nominal)), {}
    to_mm = _to_mm(unit)
    fit = Fit.of_text(text) if key == "fit" else Fit("JS", text.strip())
    size = fit.size if nominal is None else nominal * to_mm
    if size is None:
        raise ValueError("needs the nominal size of the part: give nominal")
    if fit.size is not None and not math.isclose(fit.size, size, rel_tol=1e-9):
        raise ValueError(f"is for a size of {fit.size:g} mm, but the nominal is {size:g} mm")
    iso_zone = zone(fit, size)
    nominal = size / to_mm if nominal is None else nominal
    scaled = Zone(iso_zone.mid / to_mm, iso_zone.half_width / to_mm)
    return scaled, {"nominal": nominal, "assumed": _unverified(key, [fit.grade])}


def searched_grades(section: Section, unit: str, nominal: float | None) -> tuple[Process, ...] | None:
    """`grade = ["IT5", "IT8"]`: each grade from the first to the second as a separate process.

    Each costs its `price`, or the `cost` at its half-width, plus its part of a set-up and its
    inspection. None and faults where the table does not say it all.
    """
    grades = _range(section)
    curve = read_curve(section.section("cost")) if "cost" in section else None
    prices = _prices(section, grades or ())
    if ("cost" in section) == ("price" in section):
        section.fault("cost", "give either a cost curve of t, or price = { IT6 = 12.0, IT7 = 8.5 } by grade")
    t = _half_widths(section, grades or (), unit, nominal)
    more = read_extras_by(section, grades or ())
    if grades is None or t is None or (curve is None) == (prices is None):
        return None
    processes = []
    for grade, half_width in zip(grades, t, strict=True):
        grade_cost = curve if prices is None else Reciprocal(prices[grade], 0.0)
        grade_cost = None if grade_cost is None else dearer(grade_cost, more[grade])
        processes.append(Process(half_width, half_width, grade_cost, grade))
    return tuple(processes)


def price_remark(name: str, processes: tuple[Process, ...], prices: dict[str, Any]) -> str:
    """A remark that a coarser grade is more expensive than a finer one, empty where none is."""
    listed = [(process.name, float(prices[process.name])) for process in processes if process.name in prices]
    inverted = [
        f"{coarse} costs {more:g}, {fine} {less:g}" for (fine, less), (coarse, more) in pairwise(listed) if more > less
    ]
    if not inverted:
        return ""
    return (
        f"the prices of {name} do not fall with coarser grades ({'; '.join(inverted)}): "
        "the more expensive grades are never chosen"
    )


def assumed_of(processes: tuple[Process, ...]) -> dict[str, str]:
    """Which of the grades are from an unverified part of the table."""
    return _unverified("grade", [process.name for process in processes])


def _range(section: Section) -> tuple[str, ...] | None:
    names = section.names("grade")
    if names is None:
        return None
    unknown = [name for name in names if name not in GRADES]
    for name in unknown:
        section.fault("grade", f'"{name}" is not a grade{nearest(name, GRADES)}; grades are {", ".join(GRADES)}')
    if unknown:
        return None
    if len(names) != 2 or GRADES.index(names[0]) >= GRADES.index(names[1]):
        section.fault("grade", f'must be two grades, the finer one first, like ["IT5", "IT8"]; got {", ".join(names)}')
        return None
    return GRADES[GRADES.index(names[0]) : GRADES.index(names[1]) + 1]


def _half_widths(section: Section, grades: tuple[str, ...], unit: str, nominal: float | None) -> list[float] | None:
    try:
        to_mm = _to_mm(unit)
        if nominal is None:
            raise ValueError("needs the nominal size of the part: give nominal")
        return [grade_um(grade, nominal * to_mm) / 2000.0 / to_mm for grade in grades]
    except ValueError as error:
        section.fault("grade", str(error))
        return None


def _prices(section: Section, grades: tuple[str, ...]) -> dict[str, float] | None:
    """`price = { IT6 = 12.0, IT7 = 8.5 }`, for each of the grades and no other."""
    if "price" not in section:
        return None
    table = section.section("price")
    by_grade = {grade: table.number(grade, within=Range(low=0.0)) for grade in grades}
    if not grades:  # their own fault is reported already
        table.accept(table.all_keys())
    for grade, price in by_grade.items():
        if price is None and grade not in table:
            table.fault(grade, "is missing: each grade of the range needs its price")
    table.finish()
    whole = {grade: price for grade, price in by_grade.items() if price is not None}
    return whole if grades and len(whole) == len(by_grade) else None


def _general(section: Section, text: str, unit: str, nominal: float | None) -> float:
    """Half-width of a general tolerance, in the unit of the part."""
    kind = text.strip().removeprefix("ISO 2768-").removeprefix("ISO 2768").strip()
    feature = section.text("feature", FEATURES) or "length"
    leg = section.number("leg", "mm")
    base, factor = family(unit)
    if base == "radian":
        if leg is None:
            raise ValueError('of an angle needs the length of its shorter leg: leg = "50 mm"')
        return angle_rad(kind, leg) / factor
    to_mm = _to_mm(unit)
    if nominal is None:
        raise ValueError("needs the nominal size of the part: give nominal")
    geometry = section.text("geometry", SYMBOLS)
    if geometry:
        return 0.5 * geometrical_mm(geometry, kind, nominal * to_mm) / to_mm
    return linear_mm(kind, nominal * to_mm, feature == "radius") / to_mm


def _to_mm(unit: str) -> float:
    base, factor = family(unit)
    if base != "meter":
        raise ValueError(f"applies to lengths, not to a part in {unit or 'plain numbers'}")
    return factor / family("mm")[1]


def _unverified(key: str, grades: list[str]) -> dict[str, str]:
    unverified = [grade for grade in grades if grade in UNVERIFIED]
    if not unverified:
        return {}
    verb = "has" if len(unverified) == 1 else "have"
    return {key: f"{', '.join(unverified)} of the shipped table {verb} not been verified"}
