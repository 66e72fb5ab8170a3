"""Reads `[[part]]`: every fault names the part."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ...counts import is_forced
from ...errors import Fault
from ...models.capability import PartSample, read_sample
from ...models.expressions import CONSTANTS, FUNCTIONS
from ...models.inputs import Normal
from ...models.inputs.reading import read_distribution
from ...models.iso286 import SYMBOLS
from ...section import Range, Section
from ...units import family
from .definition import Part, Process, Requirement, natural_limit
from .fits import read_fits
from .sensitivities import read_sensitivities
from .zones import KEYS, Tolerance, read_tolerance

_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
MOST = 1000
"""Pieces of a part."""
ALL = 2000
"""Pieces of all parts: a sample of 8192 units then takes some seconds."""
SOBOL = 21_201
"""Most pieces of all parts, even with --force: dimensions of a Sobol sequence (Joe, Kuo)."""


def read_parts(top: Section, requirements: Sequence[Requirement], faults: list[Fault]) -> list[Part | None]:
    """The parts, None for each that is faulty."""
    parts = []
    length_unit, fits = _length(requirements), read_fits(top, faults)
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


def stand_in(table: Mapping[str, Any], at: int) -> Part:
    """A part with the names of a faulty one, so that the other tables can be checked."""
    name, processes = table.get("name"), (Process(0.0, 1.0),) * 2
    return Part(
        name if isinstance(name, str) else f"part_{at}", "", processes, Normal(), alternatives="process" in table
    )


def _too_many(parts: Sequence[Part]) -> list[Fault]:
    """More pieces in all than a sample can be drawn of."""
    pieces, most = sum(part.count for part in parts), SOBOL if is_forced() else ALL
    if pieces <= most:
        return []
    remedy = "" if is_forced() else ", or add --force"
    return [Fault("part", f"has {pieces} pieces in all, {most} at most: merge some{remedy}")]


def _length(requirements: Sequence[Requirement]) -> str:
    """The unit of parts that state none: that of the requirements, where all are in one length."""
    units = {requirement.unit for requirement in requirements}
    return units.pop() if len(units) == 1 and family(min(units))[0] == "meter" else ""


def _read(section: Section, length_unit: str, requirements: Sequence[Requirement], fit: str) -> Part | None:
    name = _name(section)
    unit, assumed = _unit(section, length_unit)
    count = section.integer("count", Range(1, MOST))
    sensitivities = read_sensitivities(section, unit, requirements)
    distribution = read_distribution(section, Normal())
    labels = _labels(section)
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
        machines=zone.machines,
        sample=sample,
        **labels,
    )


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


def _labels(section: Section) -> dict[str, str]:
    """Geometrical characteristic, number of the drawing, number of the characteristic on it."""
    numbers = {key: _number(section, key) for key in ("drawing", "characteristic")}
    return {"geometry": section.text("geometry", SYMBOLS) or "", **numbers}


def _number(section: Section, key: str) -> str:
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
    if not _NAME.fullmatch(name):
        section.fault("name", f'must be letters, digits and _, and begin with a letter, got "{name}"')
        return None
    if name in FUNCTIONS or name in CONSTANTS:
        section.fault("name", f"{name} means something in formulas; choose another name")
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
