"""`[[joint]]`, `[base]`, `[tool]` and `[cell]` of an allocation: a serial arm with its reducers."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from ...declarations import Value
from ...models.costs.reading import read_curve
from ...models.serial_arm.cell import KINDS, Cell
from ...models.serial_arm.declared import DEG, ERRORS
from ...models.serial_arm.table import read_chain
from ...section import POSITIVE, Range, Section
from ...units import MM
from ..reducers.documents import documents_reducer
from ..reducers.nested import Nested
from ..robot.outputs import FLANKS
from .definition import Definition, Gearing, Joint, LinkError
from .shipped import shipped_arm

NOT_NEGATIVE = Range(low=0.0)
MOST_PER_EDGE = 15


def read_definition(top: Section) -> Definition | None:
    """The arm of a configuration, the shipped one where it has no `[[joint]]`; None if faulty."""
    flags = top.section("parameters")
    nested, per_drive = flags.take("nested") is not False, flags.take("per_drive") is not False
    before = len(top.faults)
    table = read_chain(top)
    rows = top.tables("joint") if "joint" in top else []
    usual = shipped_arm()
    joints = tuple(_joint(top.item("joint", at)) for at in range(len(rows)))
    count = len(rows) or len(usual.joints)
    cell = _cell(top, count, table, None if rows else usual.cell)
    if not nested:
        for at, joint in enumerate(joints):
            if joint.gearing is not None and not joint.gearing.reducer.proven:
                top.item("joint", at).fault(
                    "reducer",
                    "nested = false needs a reducer whose tolerances are known: name a configuration of rv_backlash",
                )
    if len(top.faults) > before or cell is None:
        return None
    if not rows:
        return Definition({**usual.table, **table}, usual.joints, cell, nested, per_drive, usual.shipped)
    return Definition(table, joints, cell, nested, per_drive)


def _joint(section: Section) -> Joint:
    """The keys of a row other than its columns of the table."""
    mass = section.quantity("mass_kg", "kg", NOT_NEGATIVE)
    centre = _triple(section, "centre_of_mass_mm", MM)
    heavy = "mass_kg" in section or "mass" in section
    if heavy and "centre_of_mass_mm" not in section and mass != 0.0:
        section.fault(
            "centre_of_mass_mm", "is missing: a mass needs its centre [mm] in the frame after the joint, as [x, y, z]"
        )
    if not heavy and "centre_of_mass_mm" in section:
        section.fault("mass_kg", "is missing: a centre of mass needs the mass")
    low, high = _ends(section)
    given = [kind for kind in ERRORS if f"{kind}_{ERRORS[kind][0]}" in section]
    errors = tuple((kind, _error(section, kind)) for kind in given)
    return Joint(mass, centre or (0.0, 0.0, 0.0), low, high, _gearing(section), errors)


def _ends(section: Section) -> tuple[float, float]:
    given = section.numbers("range_deg")
    if given is None:
        return Joint.low, Joint.high
    if len(given) != 2 or not given[0] < given[1]:
        section.fault("range_deg", f"must be [lowest, highest] angle, got {list(given)}")
        return Joint.low, Joint.high
    return given[0] * DEG, given[1] * DEG


def _error(section: Section, kind: str) -> LinkError | None:
    """The range and cost of one of the five errors; None where the row says that it has none."""
    name = f"{kind}_{ERRORS[kind][0]}"
    if section.take(name) == "none":
        return None
    table, usual = section.section(name), LinkError.usual(kind)
    low = table.number("low", ERRORS[kind][0], POSITIVE)
    high = table.number("high", ERRORS[kind][0], POSITIVE)
    curve = read_curve(table.section("cost"), usual.curve) if "cost" in table else usual.curve
    table.finish()
    error = LinkError(low or usual.low, high or usual.high, usual.reference, curve or usual.curve)
    if not error.low < error.high:
        table.fault("low", f"must be below high ({error.high:g}), got {error.low:g}")
    return error


def _gearing(section: Section) -> Gearing | None:
    """The reducer of a joint; that of the documents where the row has none."""
    if "reducer" not in section:
        return Gearing(documents_reducer())
    if section.take("reducer") == "none":
        return None
    table = section.section("reducer")
    reducer = table.take("run") or documents_reducer()
    keys = ("cost_factor", "backlash_factor", "te_factor")
    factors = [table.number(key, "", POSITIVE) for key in keys]
    stiffness = table.number("stiffness_Nm_per_arcmin", "Nm/arcmin", POSITIVE)
    friction = table.number("friction_torque_Nm", "Nm", NOT_NEGATIVE)
    flank, group = table.text("flank", FLANKS) or "", table.text("group") or ""
    table.finish()
    if not isinstance(reducer, Nested):  # its faults are reported where it is opened
        reducer = documents_reducer()
    cost, backlash = (1.0 if factor is None else factor for factor in factors[:2])
    return Gearing(reducer, cost, backlash, factors[2], stiffness, friction, flank, group)


def _cell(top: Section, joints: int, table: dict[str, Value], usual: Cell | None) -> Cell | None:
    """The poses; `tool_mm` goes to the table of the chain."""
    section = top.section("cell")
    tool = _triple(section, "tool_mm", 1.0)
    if tool is not None:
        if "tool" in top:
            section.fault("tool_mm", "is given twice: here and as [tool]")
        table |= {f"nominal_tool_{axis}_mm": value for axis, value in zip("xyz", tool, strict=True)}
    if "cell" not in top and usual is None:
        top.fault("cell", "is missing: give centre_mm and side_mm of a cube, or poses")
        return None
    known = usual or Cell()
    near = section.numbers("near_deg")
    if near is not None and len(near) != joints:
        section.fault("near_deg", f"must have an angle per joint ({joints}), got {len(near)}")
    more: dict[str, Any] = {
        "turn": _triple(section, "turn_deg", DEG) or known.turn,
        "near": tuple(angle * DEG for angle in near or ()),
        "of_tool": section.text("at", ("flange", "tool")) == "tool",
    }
    cell = _listed(section, joints, more) if _is_listed(section) else _cube(section, known, more)
    section.finish()
    return cell


def _is_listed(section: Section) -> bool:
    return "joints_deg" in section or isinstance(section.take("poses"), list)


def _cube(section: Section, known: Cell, more: dict[str, Any]) -> Cell:
    kind = section.text("poses") or known.kind
    if kind not in KINDS and "." not in kind:  # faults of a file are reported already
        section.fault("poses", f'must be one of {", ".join(KINDS)}, a table or a list, got "{kind}"')
    centre = _triple(section, "centre_mm", MM) or known.centre
    side = section.number("side_mm", "mm", POSITIVE)
    per_edge = section.integer("per_edge", Range(low=1, high=MOST_PER_EDGE)) or known.per_edge
    if known.side == 0.0:
        for key in ("centre_mm", "side_mm"):
            if key not in section:
                section.fault(key, "is missing: the poses are in a cube about centre_mm")
    return Cell(centre, known.side if side is None else side * MM, kind, per_edge, **more)


def _listed(section: Section, joints: int, more: dict[str, Any]) -> Cell:
    """Poses one by one: positions [mm] with or without rotation vectors [deg], or angles [deg]."""
    in_joints = "joints_deg" in section
    key = "joints_deg" if in_joints else "poses"
    for stray in ("centre_mm", "side_mm", "per_edge", *(("poses",) if in_joints else ())):
        if stray in section:
            section.take(stray)
            section.fault(stray, f"cannot be combined with a list of poses ({key}): leave it out")
    rows = section.take(key)
    widths = (joints,) if in_joints else (3, 6)
    if not isinstance(rows, list) or not rows:
        section.fault(key, "must list at least one pose")
        return Cell(**more)
    read = [_row(section, f"{key}[{at}]", row, widths) for at, row in enumerate(rows)]
    if len({len(row) for row in read if row}) > 1:
        section.fault(key, "must have a rotation vector in all rows or in none")
    unit = np.array([DEG] * joints if in_joints else [MM] * 3 + [DEG] * 3)
    whole = [tuple((np.array(row) * unit[: len(row)]).tolist()) for row in read if row]
    return Cell(listed=tuple(whole), in_joints=in_joints, **more)


def _row(section: Section, key: str, row: Any, widths: tuple[int, ...]) -> list[float]:
    if not isinstance(row, list) or len(row) not in widths:
        section.fault(key, f"must be a list of {' or '.join(map(str, widths))} numbers, got {row}")
        return []
    numbers = [section.as_number(key, value, "") for value in row]
    return [value for value in numbers if value is not None] if None not in numbers else []


def _triple(section: Section, key: str, unit: float) -> tuple[float, float, float] | None:
    """Three numbers in SI."""
    given = section.numbers(key)
    if given is None:
        return None
    if len(given) != 3 or max(abs(value) for value in given) == inf:
        section.fault(key, f"must be [x, y, z], got {list(given)}")
        return None
    x, y, z = (value * unit for value in given)
    return x, y, z
