"""Reads files of claims: everything is checked before anything is computed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..claim_records import Document
from ..errors import Fault, raise_all
from ..section import Range, Section, shown
from ..units import dimension
from ..workflows.reproduce.claims import RELATIONS, Claim, ClaimsFile, Interpretation
from ..workflows.reproduce.plan import ReproducePlan, Source
from .claim_recipes import read_recipe
from .source import Table, load, override

SHIPPED = "claims_*.toml"
HALF_UNIT = "half a unit of the last printed digit"


def shipped() -> tuple[Path, ...]:
    """The files of claims that come with the package, by name."""
    return tuple(sorted(Path(str(files("tolevo.configs"))).glob(SHIPPED)))


def read_claims(paths: Sequence[Path], overrides: Sequence[str] = ()) -> ReproducePlan:
    """The claims in TOML files (those shipped where none is named), `key=value` applied to each.

    Raises InputError with every fault of every file.
    """
    faults: list[Fault] = []
    read = {path: _source(path, overrides, faults) for path in (paths or shipped())}
    sources = {path: source for path, source in read.items() if source is not None}
    names: list[str] = []
    for path, source in sources.items():
        name = source.file.document.name
        if name in names:
            faults.append(Fault(f"{path.name}: document", f'"{name}" is read twice'))
        names.append(name)
    raise_all(faults)
    return ReproducePlan(tuple(sources.values()))


def _source(path: Path, overrides: Sequence[str], faults: list[Fault]) -> Source | None:
    """One file; its faults bear its name."""
    file_faults: list[Fault] = []
    table = load(path, faults)
    if table is None:
        return None
    override(table, overrides, file_faults)
    claims_file = _file(table, file_faults)
    if not file_faults and not claims_file.claims:
        file_faults.append(Fault("claim", "is missing: write a table [[claim]] for each printed figure"))
    faults += [Fault(f"{path.name}: {fault.place}", fault.message) for fault in file_faults]
    return Source(claims_file, json.dumps(table, sort_keys=True, default=str))


def _file(table: Table, faults: list[Fault]) -> ClaimsFile:
    top = Section(table, "", faults)
    document = Document(_needed(top, "document"), _needed(top, "title"), top.text("reference") or "")
    seed = top.integer("seed", Range(low=0), None)
    study = top.text("study") or ""
    positions: dict[str, int] = {}
    claims = []
    for at, claim_table in enumerate(top.tables("claim")):
        section = _placed(top, claim_table, at)
        name = section.text("id")
        if not name:
            section.fault("id", "is missing: name the claim")
        elif name in positions:
            section.fault("id", f'"{name}" is also the id of claim[{positions[name]}]')
        positions[name or f"[{at}]"] = at
        claim = _claim(section, name or "", study)
        if claim is not None:
            claims.append(claim)
    top.finish()
    return ClaimsFile(document, 0 if seed is None else seed, tuple(claims))


def _placed(top: Section, table: Table | Any, at: int) -> Section:
    """The claim number `at`; its place holds its id, by which a reader finds it."""
    name = table.get("id")
    return top.of(f"claim[{at}] ({name})" if isinstance(name, str) else f"claim[{at}]", table)


def _needed(section: Section, key: str, remedy: str = "") -> str:
    """A text that must be there."""
    value = section.text(key)
    if (value is None and key not in section) or (value is not None and not value.strip()):
        section.fault(key, f"is missing{remedy}")
    return value or ""


def _claim(section: Section, name: str, study: str) -> Claim | None:
    """A claim, None where it is so faulty that it cannot be tested."""
    place, quantity = _needed(section, "place"), _needed(section, "quantity")
    unit = _unit(section)
    relation = section.text("relation", RELATIONS) or "equal"
    printed, step = _printed(section)
    tolerance, reason = _tolerance(section, relation, step)
    lost = section.text("lost") or ""
    printed_as, ambiguous, why = (section.text(key) or "" for key in ("printed_as", "ambiguous", "why"))
    section.accept(["reading"])
    readings = _read_interpretations(section, unit, relation, len(printed), study)
    if lost and "reading" in section:
        section.fault("reading", "computes what `lost` states to be impossible; give only one of them")
    elif not lost and "reading" not in section:
        section.fault("reading", "is missing: state how it is recomputed ([[claim.reading]]), or what is lost")
    elif not lost and "printed" not in section:
        section.fault("printed", "is missing: the number that the document prints")
    section.finish()
    return Claim(
        name, place, quantity, unit, printed, printed_as, relation, tolerance, reason, ambiguous, lost, why, readings
    )


def _unit(section: Section) -> str:
    unit = _needed(section, "unit", ': write the unit of the printed value, "1" where it has none')
    if unit:
        try:
            dimension(unit)
        except ValueError as error:
            section.fault("unit", str(error))
            return ""
    return unit


def _printed(section: Section) -> tuple[tuple[float, ...], float]:
    """The printed numbers, and half a unit of the last digit of the coarsest of them."""
    value = section.take("printed")
    if value is None:
        return (), 0.0
    entries = value if isinstance(value, list) else [value]
    numbers, steps = [], []
    for at, entry in enumerate(entries):
        number = _digits(entry)
        if number is None:
            text = f'must be a number, or its digits as a string ("0.110"), got {shown(entry)}'
            section.fault(f"printed[{at}]" if isinstance(value, list) else "printed", text)
            continue
        numbers.append(float(number))
        steps.append(0.5 * 10.0 ** int(number.as_tuple().exponent))
    if not entries:
        section.fault("printed", "must hold at least one number")
    return tuple(numbers), max(steps, default=0.0)


def _digits(value: Any) -> Decimal | None:
    """A finite number with the digits in which it is written, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = Decimal(str(value))
    except InvalidOperation:
        return None
    if not number.is_finite():
        return None
    return Decimal(int(value)) if isinstance(value, float) and value == int(value) else number


def _tolerance(section: Section, relation: str, step: float) -> tuple[float, str]:
    """The tolerance and its reason: by default that of rounding, of an equality alone."""
    tolerance = section.number("tolerance", within=Range(low=0.0))
    reason = section.text("tolerance_reason")
    if "tolerance" in section and not (reason or "").strip():
        section.fault("tolerance_reason", "is missing: a tolerance needs its justification")
    elif reason and "tolerance" not in section:
        section.fault("tolerance", "is missing: tolerance_reason justifies nothing")
    if relation in ("above", "below") and "tolerance" in section:
        section.fault("tolerance", f'has no meaning with relation = "{relation}"')
    if tolerance is not None:
        return tolerance, reason or ""
    return (step, HALF_UNIT) if relation == "equal" and step else (0.0, "")


def _read_interpretations(
    section: Section, unit: str, relation: str, count: int, study: str
) -> tuple[Interpretation, ...]:
    """How the claim is recomputed; every interpretation but the first states what it assumes."""
    if relation == "within" and count != 2:
        section.fault("printed", f"must be [low, high] where the relation is within, got {count}")
    wanted = 1 if relation == "within" else count
    interpretations = []
    for at, reading in enumerate(section.items("reading")):
        states = reading.text("states") or ""
        if at and not states.strip():
            reading.fault("states", "is missing: only the first interpretation may be the literal one")
        recipe = read_recipe(reading, wanted, unit, study)
        reading.finish()
        if recipe is not None:
            interpretations.append(Interpretation(recipe, states))
    return tuple(interpretations)
