"""`[[joint]]`, `[base]` and `[tool]`: a serial arm as a configuration writes it."""

from __future__ import annotations

from ...declarations import Value
from ...section import Section
from .declared import BASE, ERRORS, MOST, TABLE, TOOL, frame_units, nominal

TABLES = ("joint", "base", "tool")
OF_ALLOCATIONS = (
    "mass_kg",
    "mass",
    "centre_of_mass_mm",
    "range_deg",
    "reducer",
    *(f"{kind}_{unit}" for kind, (unit, _, _) in ERRORS.items()),
)
"""Keys of a row that an allocation of tolerances reads; a model alone has no use for them."""


def read_chain(top: Section) -> dict[str, Value]:
    """The parameters that these tables define; every fault is reported at its place."""
    values = _frame(top.section("base"), "base", BASE) | _frame(top.section("tool"), "tool", TOOL)
    if "joint" not in top:
        return values
    rows = top.tables("joint")
    if not 1 <= len(rows) <= MOST:
        top.fault("joint", f"is no chain: it has {len(rows)} rows, and needs 1 to {MOST}")
        return values
    joints = [_joint(top.item("joint", at), at + 1) for at in range(len(rows))]
    for joint in joints:
        values |= joint
    _check(top, joints)
    return values | {"joints": len(rows)}


def _joint(section: Section, joint: int) -> dict[str, Value]:
    """A row: d, a and alpha are required, since defaults would be those of another arm."""
    values: dict[str, Value] = {}
    for column, (unit, meaning) in TABLE.items():
        name = f"{column}_{unit}"
        value = section.quantity(name, unit)
        if value is not None:
            values[nominal(column, joint)] = value
        elif name not in section and column not in section and column != "offset":
            section.fault(name, f"is missing: the {meaning} {joint}; write 0 where there is none")
    values.setdefault(nominal("offset", joint), 0.0)
    section.accept(OF_ALLOCATIONS)
    section.finish()
    return values


def _check(top: Section, rows: list[dict[str, Value]]) -> None:
    """Faults of a table whose joints do not make a chain."""

    def value(column: str, joint: int) -> float | None:
        entry = rows[joint - 1].get(nominal(column, joint))
        return float(entry) if isinstance(entry, int | float) else None

    last = len(rows)
    for joint in range(1, last):
        alpha = value("alpha", joint)
        if value("a", joint) == 0.0 and alpha is not None and alpha % 180.0 == 0.0:
            top.item("joint", joint - 1).fault(
                "", f"is no chain: joints {joint} and {joint + 1} turn about one axis (a and alpha are 0)"
            )
    lengths = [value(column, joint) for joint in range(1, last + 1) for column in ("a", "d")]
    if None not in lengths and not any(lengths):
        top.fault("joint", "is no chain: every a and d is 0")


def _frame(section: Section, stem: str, axes: tuple[str, ...]) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for axis in axes:
        unit, _ = frame_units(axis)
        value = section.quantity(f"{axis}_{unit}", unit)
        if value is not None:
            values[f"nominal_{stem}_{axis}_{unit}"] = value
    section.finish()
    return values
