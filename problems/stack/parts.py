"""Reads `[[fit]]` and `[[part]]` and writes the latter back: what a part states is known to no other module."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import ndtr

from ...errors import Fault, nearest
from ...models.capability import PartSample, read_sample
from ...models.cost_reading import add_constant_cost, curve_table, name_of, read_curve, read_extras, read_extras_by
from ...models.costs import CostCurve, Reciprocal, Table
from ...models.input_reading import read_distribution, written
from ...models.inputs import Normal, Zone
from ...models.iso286 import (
    GRADES,
    SYMBOLS,
    UNVERIFIED,
    Fit,
    angle_rad,
    characteristic_of,
    geometrical_mm,
    grade_um,
    linear_mm,
    pair_of_text,
    zone,
)
from ...models.machine_offers import Offer, Owner, read_offers, ways_of
from ...section import POSITIVE, Range, Section, is_forced, shown
from ...units import family, fits
from .definition import Part, Process, Requirement, natural_limit, processes_of
from .formulas import name_complaint, read_sensitivities


def read_fits(top: Section, faults: list[Fault]) -> dict[str, str]:
    """The tolerance class, like "25 H7", of each part that is in a `[[fit]]`.

    `parts` names the part with the hole first, `size` states the fit.
    """
    known = [name for table in top.tables("part") if isinstance(name := table.get("name"), str)]
    by_part: dict[str, str] = {}
    for at in range(len(top.tables("fit"))):
        section = top.item("fit", at, faults)
        names, text = section.names("parts"), section.text("size")
        for key, like in (("parts", '["bore", "pin"]'), ("size", '"25 H7/g6"')):
            if key not in section:
                section.fault(key, f"is missing: write {key} = {like}")
        section.finish()
        if names is not None:
            _check(section, names, known, by_part)
        if text is None:
            continue
        try:
            classes = pair_of_text(text)
        except ValueError as error:
            section.fault("size", str(error))
            continue
        for name, fit in zip(names or (), classes, strict=False):
            by_part[name] = f"{fit.size:g} {fit}" if fit.size is not None else str(fit)
    return by_part


def _check(section: Section, names: list[str], known: list[str], by_part: dict[str, str]) -> None:
    if len(names) != 2 or names[0] == names[1]:
        section.fault("parts", f"must name two different parts, the hole first, got {', '.join(names)}")
    for name in names:
        if name not in known:
            section.fault("parts", f'"{name}" is not a part{nearest(name, known)}')
        elif name in by_part:
            section.fault("parts", f"{name} is in another [[fit]] already")


# Zones of parts by standards: grades and fits (ISO 286), general tolerances (ISO 2768).


DRAWN_AS = ("diameter", "radius")
"""What a size is, so that a drawing shows a diameter as one."""
EXTRA_ZONE_KEYS = ("geometry", "price", "feature", "leg")
"""Keys other than that of the zone: prices of grades, the geometrical characteristic of ISO 1101,
and what a general tolerance is of.
"""
COSTS = ("cost", "setup", "inspection")
"""Keys for costs of grades other than their prices."""
FEATURES = ("length", "radius")


def read_standard_zone(
    section: Section, key: str, text: str, unit: str, nominal: float | None
) -> tuple[Zone, dict[str, Any]]:
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
    return scaled, {"nominal": nominal, "assumed": _unverified_note(key, [fit.grade])}


def read_searched_grades(section: Section, unit: str, nominal: float | None) -> tuple[Process, ...] | None:
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
        grade_cost = None if grade_cost is None else add_constant_cost(grade_cost, more[grade])
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


def unverified_grades(processes: tuple[Process, ...]) -> dict[str, str]:
    """Which of the grades are from an unverified part of the table."""
    return _unverified_note("grade", [process.name for process in processes])


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


def _unverified_note(key: str, grades: list[str]) -> dict[str, str]:
    unverified = [grade for grade in grades if grade in UNVERIFIED]
    if not unverified:
        return {}
    verb = "has" if len(unverified) == 1 else "have"
    return {key: f"{', '.join(unverified)} of the shipped table {verb} not been verified"}


# How a part states its tolerance: a range, a fixed value, limits, a grade, a fit, processes.


KEYS = ("t_min", "tolerance", "limits", "grade", "fit", "general", "process", "machine")
"""The statements of a zone, by their first key; exactly one is given, except that machines may be
given with processes, and with t_min and t_max, the limits of their inspection, and that a tolerance
beside t_min and t_max is the one that the drawing has now."""
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
    present: float | None = None


def read_tolerance(section: Section, unit: str, nominal: float | None, fit: str = "") -> Tolerance | None:
    """The zone that the table of a part states, None and faults where it states none.

    `fit` is its tolerance class by a `[[fit]]` of two parts, empty where it is in none.
    """
    given = [key for key in KEYS if key in section or (key == "t_min" and "t_max" in section)]
    section.accept((*KEYS, *EXTRA_ZONE_KEYS, "t_max", "cost"))
    if fit and not given:
        section, given = section.having("fit", fit), ["fit"]
    elif fit:
        section.fault(given[0], f"is a second statement in addition to {fit} of its [[fit]]: keep only one")
        return None
    if given in (["t_min"], ["t_min", "tolerance"]):
        process = read_process(section, unit, nominal)
        present = _half_width(section, "tolerance", unit, nominal, POSITIVE) if "tolerance" in section else None
        return None if process is None else Tolerance((process,), present=present)
    if set(given) in MADE:
        return _alternatives(section, unit, nominal)
    if len(given) != 1:
        what = f"has too many: {', '.join(given)}; keep only one" if given else "has none"
        section.fault("", f"needs one statement of its tolerance and {what}: {REMEDY}")
        if "cost" in section:
            read_curve(section.section("cost"))
        return None
    if given == ["grade"] and isinstance(section.take("grade"), list):
        grades = read_searched_grades(section, unit, nominal)
        if grades is None:
            return None
        costs = {key: section.take(key) for key in COSTS if key in section}
        return Tolerance(
            grades, alternatives=True, stated=stated_standard(section) | costs, assumed=unverified_grades(grades)
        )
    fixed = _read_fixed_zone(section, given[0], unit, nominal)
    curve = _read_cost(section) if "cost" in section else None
    if fixed is None:
        return None
    shape, tolerance = fixed
    _check_cost(section, given[0], curve, shape.half_width, unit)
    process = Process(shape.half_width, shape.half_width, curve)
    return Tolerance((process,), True, False, shape.mid, **tolerance)


_PERCENT = re.compile(r"\s*([^\s%]+)\s*(?:%|percent)\s*")


def _half_width(section: Section, key: str, unit: str, nominal: float | None, within: Range) -> float | None:
    """A half-width as a number, with a unit, or as a percentage of the nominal: "1 %"."""
    value = section.take(key)
    percent = _PERCENT.fullmatch(value) if isinstance(value, str) and family(unit)[0] else None
    if percent is None:
        return section.number(key, unit, within)
    try:
        share = float(percent[1])
    except ValueError:
        section.fault(key, f'must be a percentage of the nominal, like "1 %", got {shown(value)}')
        return None
    if not nominal:
        what = "is missing" if nominal is None else "is 0"
        section.fault(key, f"is {share:g} % of the nominal, which {what}: state the half-width in {unit}")
        return None
    return section.as_number(key, float(f"{share * abs(nominal) / 100.0:.12g}"), unit, within)


def read_process(section: Section, unit: str, nominal: float | None, name: str = "") -> Process | None:
    """A range with its cost, or one tolerance with its price."""
    if name and ("tolerance" in section or "price" in section):
        return _process_at_one_tolerance(section, unit, nominal, name)
    low, high = (_half_width(section, key, unit, nominal, POSITIVE) for key in ("t_min", "t_max"))
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
    low, high, note = _narrow_to_cost_table(low, high, curve, unit)
    for key, end in (("t_min", low), ("t_max", high)):
        _check_cost(section, key, curve, end, unit)
    return Process(low, high, curve, name, note=note)


def _process_at_one_tolerance(section: Section, unit: str, nominal: float | None, name: str) -> Process | None:
    """`tolerance = 0.01, price = 4.2`, or with a `cost` curve in the place of the price."""
    t = _half_width(section, "tolerance", unit, nominal, POSITIVE)
    price = section.number("price", within=Range(low=0.0))
    if "tolerance" not in section:
        section.fault("tolerance", "is missing: a price is that of one tolerance; of a range state a cost")
    for key in ("t_min", "t_max"):
        if key in section:
            section.take(key)
            section.fault(key, "is stated in addition to tolerance or price: state a range with a cost, or neither end")
    if ("price" in section) == ("cost" in section):
        section.fault("price", "give either a price, or a cost curve of t")
    curve: CostCurve | None = read_curve(section.section("cost")) if "cost" in section else None
    curve, more = Reciprocal(price, 0.0) if price is not None else curve, read_extras(section)
    if t is None or curve is None:
        return None
    _check_cost(section, "tolerance", curve, t, unit)
    return Process(t, t, add_constant_cost(curve, more), name)


def _narrow_to_cost_table(low: float, high: float, curve: CostCurve | None, unit: str) -> tuple[float, float, str]:
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
    return None if curve is None else add_constant_cost(curve, more)


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
        processes = section.named_items("process", lambda table, name: read_process(table, unit, nominal, name))
    if "machine" not in section:
        return None if processes is None else Tolerance(processes, alternatives=True)
    ends = [section.number(key, unit, POSITIVE) for key in ("t_min", "t_max")]
    offers = read_offers(section, Owner(unit, (ends[0], ends[1]), nominal))
    if processes is None or offers is None:
        return None
    labels = {way.label for way in ways_of(offers)}
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


def _read_fixed_zone(
    section: Section, key: str, unit: str, nominal: float | None
) -> tuple[Zone, dict[str, Any]] | None:
    """The zone about the nominal that a bought-in part has."""
    if key == "tolerance":
        value, text = _half_width(section, "tolerance", unit, nominal, Range(low=0.0)), section.take("tolerance")
        as_percentage = isinstance(text, str) and _PERCENT.fullmatch(text)
        return None if value is None else (Zone(0.0, value), {"stated": {key: text if as_percentage else value}})
    text = section.text(key)
    if text is None:
        return None
    try:
        if key == "limits":
            return _limits(text), {"stated": {key: text}}
        zone, more = read_standard_zone(section, key, text, unit, nominal)
    except ValueError as error:
        section.fault(key, str(error))
        return None
    return zone, {"stated": stated_standard(section) | {key: text}} | more


def stated_standard(section: Section) -> dict[str, Any]:
    """The keys of a part's table that state the standard of its zone, as written."""
    keys = ("grade", *(key for key in EXTRA_ZONE_KEYS if key != "geometry"))
    return {key: section.take(key) for key in keys if key in section}


def _limits(text: str) -> Zone:
    zone = Zone.of_text(text)
    if not (math.isfinite(zone.mid) and math.isfinite(zone.half_width)):
        raise ValueError(f'must be finite, got "{text}"')
    return zone


# Reads `[[part]]`: every fault names the part.


MAX_PIECES_PER_PART = 1000
"""Pieces of a part."""
MAX_PIECES = 2000
"""Pieces of all parts: a sample of 8192 units then takes some seconds."""
SOBOL = 21_201
"""Most pieces of all parts, even with --force: dimensions of a Sobol sequence (Joe, Kuo)."""


def read_parts(top: Section, requirements: Sequence[Requirement], faults: list[Fault]) -> list[Part | None]:
    """The parts, None for each that is faulty."""
    parts = []
    length_unit, fits = length_unit_of(requirements), read_fits(top, faults)
    for at in range(len(top.tables("part"))):
        part_faults: list[Fault] = []
        section = top.item("part", at, part_faults)
        name = section.take("name")
        fit = fits.get(name, "") if isinstance(name, str) else ""
        parts.append(_read(section, length_unit, requirements, fit))
        section.finish()
        faults += [
            Fault(f.place, f"{f.message} (part {name})" if isinstance(name, str) else f.message) for f in part_faults
        ]
    known = [part for part in parts if part is not None]
    faults += [*_duplicates(known), *_too_many(known)]
    return parts


def placeholder_part(table: Mapping[str, Any], at: int) -> Part:
    """A part with the names of a faulty one, so that the other tables can be checked; of any tolerance."""
    name, processes = table.get("name"), (Process(0.0, np.inf),) * 2
    chosen = "process" in table or "machine" in table
    return Part(name if isinstance(name, str) else f"part_{at}", "", processes, Normal(), alternatives=chosen)


def _too_many(parts: Sequence[Part]) -> list[Fault]:
    """More pieces in all than a sample can be drawn of."""
    pieces, most = sum(part.count for part in parts), SOBOL if is_forced() else MAX_PIECES
    if pieces <= most:
        return []
    remedy = "" if is_forced() else ", or add --force"
    return [Fault("part", f"has {pieces} pieces in all, {most} at most: merge some{remedy}")]


def length_unit_of(requirements: Sequence[Requirement]) -> str:
    """The unit of parts that state none: that of the requirements, where all are in one length."""
    units = {requirement.unit for requirement in requirements}
    return units.pop() if len(units) == 1 and family(min(units))[0] == "meter" else ""


def _read(section: Section, length_unit: str, requirements: Sequence[Requirement], fit: str) -> Part | None:
    name = _name(section)
    if isinstance(geometry := section.take("geometry"), str):
        section = section.having("geometry", characteristic_of(geometry))
    unit, assumed = _unit(section, length_unit)
    count = section.integer("count", Range(1, MAX_PIECES_PER_PART))
    sensitivities = read_sensitivities(section, unit, requirements)
    expansion, material = _expansion(section, unit)
    distribution = read_distribution(section, Normal())
    labels = _labels(section, unit)
    section.accept(("measured",))  # known, though it is not read where the zone has a fault
    if unit is None:
        section.accept(("nominal", "t_max", "cost", *KEYS))
        return None
    nominal = section.number("nominal", unit)
    zone = read_tolerance(section, unit, nominal, fit)
    if name is None or zone is None or distribution is None:
        return None
    if distribution.one_sided and (conflicting := [key for key in ("limits", "fit") if key in section]):
        section.fault("distribution", f"a radius lies between 0 and its tolerance: leave out {', '.join(conflicting)}")
        return None
    if zone.machines and not (isinstance(distribution, Normal) and distribution.shift == 0.0):
        section.fault(
            "distribution", "must be normal and centred where machines are stated: state mean in [[part.machine]]"
        )
        return None
    sample = None
    if "measured" in section:
        sample = _sample(section, unit, nominal, zone, bool(labels["geometry"]))
        if sample is None:
            return None
        distribution = sample.distribution
        assumed |= sample.assumed
    elif "distribution" not in section and not zone.machines:
        assumed["distribution"] = "normal; the configuration names none"
    return Part(
        name=name,
        unit=unit,
        processes=zone.processes,
        distribution=distribution,
        nominal=zone.nominal if nominal is None else nominal,
        mid=zone.mid,
        count=1 if count is None else count,
        fixed=zone.fixed,
        alternatives=zone.alternatives,
        sensitivities=sensitivities,
        stated=zone.stated,
        assumed=assumed | zone.assumed,
        expansion=expansion,
        material=material,
        machines=zone.machines,
        sample=sample,
        present=zone.present,
        **labels,
    )


def _expansion(section: Section, unit: str | None) -> tuple[float | None, str]:
    """Linear expansion and material; None and empty where they are not stated."""
    if "expansion" not in section and "material" not in section:
        section.accept(("expansion", "material"))
        return None, ""
    from .conditions import read_expansion  # few stacks state any

    return read_expansion(section, unit)


def _sample(
    section: Section, unit: str, nominal: float | None, zone: Tolerance, geometrical: bool
) -> PartSample | None:
    """The sample of measured parts, None and faults where it does not apply."""
    stated = [key for key in ("distribution", "cp", "cpk", "shift") if key in section]
    for key in stated:
        section.fault(key, "is stated in addition to [part.measured], from which it follows: keep only one of the two")
    if zone.machines or len(zone.processes) != 1:
        section.fault(
            "measured", "is of a single process: a part with several needs the scatter of machines, or a distribution"
        )
        return None
    (process,) = zone.processes
    nominal = zone.nominal if nominal is None else nominal
    natural = natural_limit(zone.mid, process.high) if zone.fixed and geometrical else 0
    t = process.high if zone.fixed else None
    sample = read_sample(section, unit, nominal, zone.mid, t, natural=natural)
    return None if stated else sample


def _labels(section: Section, unit: str | None) -> dict[str, Any]:
    """Geometrical characteristic, how it is drawn, number of the drawing, number of the characteristic
    on it, and where the tolerance comes from.
    """
    numbers = {key: drawing_number(section, key) for key in ("drawing", "characteristic")}
    angle = section.take("drawn_as")
    if isinstance(angle, str) and angle.startswith("at "):
        section.as_number("drawn_as", angle.removeprefix("at "), "mm", POSITIVE)
        if unit is not None and not (unit and fits(unit, "rad")):
            section.fault("drawn_as", f'is of an angle, and the part is in "{unit}": write {" or ".join(DRAWN_AS)}')
    known = (("geometry", SYMBOLS), ("drawn_as", () if str(angle).startswith("at ") else DRAWN_AS), ("source", ()))
    texts = {key: section.text(key, choices) for key, choices in known}
    return numbers | {key: text or "" for key, text in texts.items()}


def drawing_number(section: Section, key: str) -> str:
    """A number of a drawing: with quotes or without."""
    value = section.take(key)
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return section.text(key) or ""


def _name(section: Section) -> str | None:
    name = section.text("name")
    if name is None:
        if "name" not in section:
            section.fault("name", "is missing: name the part")
        return None
    if why := name_complaint(name):
        section.fault("name", why)
        return None
    return name


def _unit(section: Section, length_unit: str) -> tuple[str | None, dict[str, str]]:
    """The unit of a part, and what is assumed where it states none."""
    unit = section.text("unit")
    if "unit" not in section:
        if not length_unit:
            section.fault("unit", 'is missing: write "mm", "um", "deg", ...')
            return None, {}
        return length_unit, {"unit": "that of the requirement; the configuration names none"}
    try:
        family(unit or "")
    except ValueError as error:
        section.fault("unit", str(error))
        return None, {}
    return unit, {}


def _duplicates(parts: Sequence[Part]) -> list[Fault]:
    """A fault for every name that is ambiguous in a formula."""
    owners: dict[str, str] = {}
    faults = []
    for part in parts:
        for piece in dict.fromkeys((part.name, *part.pieces)):
            if piece in owners:
                text = f'"{piece}" is already a name of part {owners[piece]}; rename part {part.name}'
                faults.append(Fault("part", text))
            owners[piece] = part.name
    return faults


# Writes a part back: reading the table again gives the same part.


def part_table(part: Part) -> dict[str, Any]:
    """The `[[part]]` table that a part is read from."""
    table: dict[str, Any] = {"name": part.name, "unit": part.unit, "count": part.count}
    if part.nominal is not None:
        table["nominal"] = part.nominal
    if part.sensitivities:
        table["sensitivity"] = part.sensitivities.get("", dict(part.sensitivities))
    table |= written(part.distribution) if part.sample is None else {"measured": dict(part.sample.stated)}
    labels = {key: getattr(part, key) for key in ("drawing", "characteristic", "geometry", "drawn_as", "source")}
    table |= {key: value for key, value in labels.items() if value}
    if part.expansion is not None:
        table |= {"material": part.material} if part.material else {"expansion": part.expansion}
    if part.machines:
        processes = [{"name": p.name} | _range_table(p) for p in part.processes if p.machine is None]
        return (
            table
            | ({"process": processes} if processes else {})
            | {"machine": [offer.table() for offer in part.machines]}
        )
    if part.alternatives and part.stated:  # grades
        return table | dict(part.stated)
    if part.alternatives:
        return table | {"process": [{"name": p.name} | _range_table(p) for p in part.processes]}
    if part.fixed:
        return table | dict(part.stated) | _cost_table(part.processes[0])
    present = {} if part.present is None else {"tolerance": part.present}
    return table | _range_table(part.processes[0]) | present


def _range_table(process: Process) -> dict[str, Any]:
    if process.low < process.high:
        return {"t_min": process.low, "t_max": process.high} | _cost_table(process)
    price = process.curve.a if isinstance(process.curve, Reciprocal) and process.curve.b == 0.0 else None
    return {"tolerance": process.low} | ({"price": price} if price is not None else _cost_table(process))


def _cost_table(process: Process) -> dict[str, Any]:
    return {} if process.curve is None else {"cost": curve_table(process.curve)}


# What a drawing states of a part in addition to its limits: class, symbol, numbers.


def drawn(part: Part) -> dict[str, str]:
    """Tolerance class or grade as stated, symbol of the geometrical characteristic (ISO 1101) with
    its name, numbers of drawing and characteristic, capability and mean of its process; what is not
    stated is left out.
    """
    labels = {"class": _class(part)}
    labels |= {key: getattr(part, key) for key in ("drawing", "characteristic", "source", "drawn_as")}
    if part.geometry:
        labels["symbol"] = f"{SYMBOLS[part.geometry]} {part.geometry.replace('_', ' ')}"
    capability = part.stated.get("cpk") or getattr(part.distribution, "cp", None)
    if part.one_sided:
        capability, labels["inspection"] = _one_sided_capability(part)
    elif part.distribution.one_sided and isinstance(capability, int | float):
        labels["inspection"] = f"at most {100.0 * ndtr(-3.0 * capability):.3g} % of the parts beyond the limit"
    elif part.sample is not None and part.sample.offset:
        labels["mean"] = f"mean {part.sample.offset:+.3g} {part.unit} from the mid-limit, as measured"
    if isinstance(capability, int | float):
        labels["cpk"] = f"{capability:g}"
    return {key: value for key, value in labels.items() if value}


def _one_sided_capability(part: Part) -> tuple[float, str]:
    """Cpk of a part with one limit, and what the model assumes of its process: it has no Cp."""
    m1, m2 = part.distribution.raw_moments(2)[1:]
    std, mean = part.high * math.sqrt(m2 - m1**2), part.mean + part.high * m1
    if part.sample is not None and "Cpk" in part.sample.indices:
        cpk = part.sample.indices["Cpk"].value
    else:
        cpk = (part.high + part.natural * (mean - part.mid)) / (3.0 * std)
    return cpk, f"standard deviation {std:.3g} {part.unit}, mean {mean:+.3g} {part.unit} from the nominal, one limit"


def labels_of(requirement: Requirement) -> dict[str, object]:
    """Labels of a requirement for readers: name, limits and their unit, description, drawing."""
    labels = {key: getattr(requirement, key) for key in ("name", "lower", "upper", "unit", "description", "drawing")}
    return {key: value for key, value in labels.items() if value not in (None, "")}


def _class(part: Part) -> str:
    """Like g6 of a fit, IT6 of a fixed grade, ISO 2768-m of a general tolerance."""
    fit, grade, general = (part.stated.get(key) for key in ("fit", "grade", "general"))
    if isinstance(fit, str):
        return str(Fit.of_text(fit))
    if isinstance(general, str):
        return f"ISO 2768-{general.removeprefix('ISO 2768-').removeprefix('ISO 2768').strip()}"
    return grade.strip() if isinstance(grade, str) else ""
