"""What a configuration of `serial_arm` declares: joints, their reducers, and the cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf
from typing import Any

import numpy as np

from ...models.cost_reading import curve_table, read_curve
from ...models.costs import CostCurve, Reciprocal
from ...models.serial_arm import arm
from ...models.serial_arm.arm import DEG, ERRORS, nominal, read_chain
from ...models.serial_arm.kinematics import KINDS, Cell
from ...section import POSITIVE, Array, Kind, Parameter, Range, Section, Value, Variable, completed, number
from ...units import MM
from ..nested_reducers import Nested, documents_reducer
from ..pose_accuracy.outputs import RANGE
from ..robot import problem
from ..robot.problem import FLANKS, Drive
from ..robot.problem import PARAMETERS as OF_ROBOTS

REFERENCE = {"um": 20.0, "mrad": 0.05}
"""Standard deviation of relative cost 1 of an error of a joint."""
PAYLOAD = 5.0
"""Payload of an arm [kg]."""


@dataclass(frozen=True)
class LinkError:
    """One of the five errors of a joint: range of its standard deviation, reference, cost."""

    low: float
    high: float
    reference: float
    curve: CostCurve

    @classmethod
    def usual(cls, kind: str) -> LinkError:
        """The default range and cost of an error of a `kind`."""
        reference = REFERENCE[arm.ERRORS[kind][0]]
        low, high = (factor * reference for factor in RANGE)
        return cls(low, high, reference, Reciprocal(0.0, reference))


@dataclass(frozen=True)
class Gearing:
    """The reducer of a joint. `stiffness` [N m/arcmin] and `friction` [N m] are None, and `flank`
    empty, where the parameters say; `te_factor` is None where it equals `backlash_factor`.
    """

    reducer: Nested
    cost_factor: float = 1.0
    backlash_factor: float = 1.0
    te_factor: float | None = None
    stiffness: float | None = None
    friction: float | None = None
    flank: str = ""
    group: str = ""


@dataclass(frozen=True)
class Joint:
    """A joint apart from its row of the table: mass [kg] and its centre [m] in the frame after it,
    the range of its angle [rad], its reducer (None: a direct drive), and its errors by kind.
    """

    mass: float | None = None
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    low: float = -2.0 * np.pi
    high: float = 2.0 * np.pi
    gearing: Gearing | None = None
    errors: tuple[tuple[str, LinkError | None], ...] = ()

    @property
    def links(self) -> Mapping[str, LinkError]:
        """Its errors by kind: all five but those that are None."""
        given = dict(self.errors)
        every = {kind: given.get(kind, LinkError.usual(kind)) for kind in arm.ERRORS}
        return {kind: error for kind, error in every.items() if error is not None}


@dataclass(frozen=True)
class Definition(problem.Definition):
    """An arm: `table` holds the parameters of its chain as the model declares them."""

    table: Mapping[str, Value]
    joints: tuple[Joint, ...]
    cell: Cell
    nested: bool = True
    per_drive: bool = True
    shipped: str = ""
    """What the arm is, where the configuration has no table."""

    @cached_property
    def gearings(self) -> dict[int, Gearing]:
        """Joints with a reducer, from 0."""
        return {at: joint.gearing for at, joint in enumerate(self.joints) if joint.gearing is not None}

    @property
    def drives(self) -> tuple[Drive, ...]:
        return tuple(_drive(str(at + 1), gearing) for at, gearing in self.gearings.items())

    @cached_property
    def errors(self) -> Mapping[str, LinkError]:
        """The errors of all joints by variable, joint after joint."""
        return {
            arm.error(kind, at): error for at, joint in enumerate(self.joints, 1) for kind, error in joint.links.items()
        }

    @property
    def link_variables(self) -> tuple[Variable, ...]:
        kinds = {
            arm.error(kind, at): (at, *row) for at in range(1, len(self.joints) + 1) for kind, row in arm.ERRORS.items()
        }
        return tuple(
            Variable(
                name,
                kinds[name][1],
                Kind.STANDARD_DEVIATION,
                error.low,
                error.high,
                f"standard deviation of the {kinds[name][2]} {kinds[name][0]}",
                valid_low=1e-9,
            )
            for name, error in self.errors.items()
        )

    @property
    def link_costs(self) -> Mapping[str, CostCurve]:
        return {name: error.curve for name, error in self.errors.items()}

    @property
    def link_references(self) -> Mapping[str, float]:
        return {name: error.reference for name, error in self.errors.items()}

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the chain, the table as their defaults, and those of every machine."""
        count = len(self.joints)
        chain_parameters = [p for p in arm.PARAMETERS if arm.joint_of(p.name) <= count]
        table = {**completed(chain_parameters, {}), **self.table, "joints": count}
        chain = [replace(p, default=table[p.name], source="") for p in chain_parameters]
        chain = [replace(p, low=count, high=count) if p.name == "joints" else p for p in chain]
        return (*chain, *(replace(p, default=PAYLOAD) if p.name == "payload_kg" else p for p in OF_ROBOTS))

    @property
    def near(self) -> Array:
        """Joint angles (k,) [rad] near which the posture is chosen."""
        return np.array(self.cell.near or (0.0,) * len(self.joints))

    @property
    def ends(self) -> tuple[Array, Array]:
        """Ranges (k,) of the joints' angles [rad]."""
        return np.array([joint.low for joint in self.joints]), np.array([joint.high for joint in self.joints])

    def of_joints(self, name: str, parameters: Mapping[str, Value], parameter: str) -> Array:
        """A number (geared,) of the reducers, the parameter's where a joint has none."""
        usual = number(parameters[parameter])
        given = [getattr(gearing, name) for gearing in self.gearings.values()]
        return np.array([usual if value is None else value for value in given])


def _drive(key: str, gearing: Gearing) -> Drive:
    te = gearing.backlash_factor if gearing.te_factor is None else gearing.te_factor
    return Drive(key, gearing.reducer, gearing.cost_factor, gearing.backlash_factor, te, gearing.group)


# The arm of a configuration without a table: KUKA KR 5 arc.


SOURCE = (
    "KUKA KR 5 arc: Denavit-Hartenberg table of Robotics Toolbox for Python 1.5 (P. Corke, "
    "J. Haviland, MIT licence), after A. Gil's ARTE; masses, wrist and cell are assumed"
)
ROWS = {
    "d": (400.0, 0.0, 0.0, -620.0, 0.0, -115.0),
    "a": (180.0, 600.0, 120.0, 0.0, 0.0, 0.0),
    "alpha": (-90.0, 0.0, 90.0, -90.0, 90.0, 180.0),
    "offset": (0.0,) * 6,
}
MASS = (30.0, 22.0, 30.0, 5.0, 3.0, 2.0)
CENTRE = ((-0.08, 0.0, 0.05), (-0.32, 0.0, 0.1), (-0.02, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.02), (0.0, 0.0, 0.03))
STIFFNESS = (108.0, 108.0, 108.0, 20.0, 20.0, 10.0)
WRIST = 3
"""Joints before the wrist, whose reducers cost half and have 1.5 times the backlash."""


@lru_cache(maxsize=4)
def shipped_arm(nested: bool = True, per_drive: bool = True, cell: Cell | None = None) -> Definition:
    """The KR 5 arc before a cube of 400 mm, tool down."""
    table = {nominal(column, at): value for column, row in ROWS.items() for at, value in enumerate(row, 1)}
    joints = tuple(
        Joint(
            mass, centre, gearing=Gearing(documents_reducer(), *((1.0, 1.0) if at < WRIST else (0.5, 1.5)), stiffness=k)
        )
        for at, (mass, centre, k) in enumerate(zip(MASS, CENTRE, STIFFNESS, strict=True))
    )
    return Definition(table, joints, cell or Cell((0.85, 0.0, 0.7), 0.4), nested, per_drive, SOURCE)


# `[[joint]]`, `[base]`, `[tool]` and `[cell]` of an allocation: a serial arm with its reducers.


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
    cell = (
        _read_listed_poses(section, joints, more)
        if "joints_deg" in section or isinstance(section.take("poses"), list)
        else _cube(section, known, more)
    )
    section.finish()
    return cell


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


def _read_listed_poses(section: Section, joints: int, more: dict[str, Any]) -> Cell:
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


# The tables of an arm, as `reading` reads them.


def definition_tables(definition: Definition, parameters: Mapping[str, Value]) -> dict[str, Any]:
    """`[[joint]]`, `[base]`, `[tool]`, `[cell]`, and the other parameters."""
    rows = [_joint_table(parameters, at, joint) for at, joint in enumerate(definition.joints, 1)]
    frames = {stem: _frame(stem, axes, parameters) for stem, axes in (("base", arm.BASE), ("tool", arm.TOOL))}
    remaining = {
        name: value for name, value in parameters.items() if not name.startswith("nominal_") and name != "joints"
    }
    return {"parameters": remaining, "joint": rows, **frames, "cell": _cell_table(definition.cell)}


def _joint_table(parameters: Mapping[str, Value], at: int, joint: Joint) -> dict[str, Any]:
    table: dict[str, Any] = {
        f"{column}_{unit}": parameters[arm.nominal(column, at)] for column, (unit, _) in arm.TABLE.items()
    }
    if joint.mass is not None:
        table |= {"mass_kg": joint.mass, "centre_of_mass_mm": _scale_for_table(joint.centre, MM)}
    table["range_deg"] = _scale_for_table((joint.low, joint.high), arm.DEG)
    table["reducer"] = "none" if joint.gearing is None else _gearing_table(joint.gearing)
    return table | {f"{kind}_{arm.ERRORS[kind][0]}": _error_table(error) for kind, error in joint.errors}


def _gearing_table(gearing: Gearing) -> dict[str, Any]:
    numbers = {
        "te_factor": gearing.te_factor,
        "stiffness_Nm_per_arcmin": gearing.stiffness,
        "friction_torque_Nm": gearing.friction,
    }
    words = {"flank": gearing.flank, "group": gearing.group}
    return {
        "run": dict(gearing.reducer.tables),
        "cost_factor": gearing.cost_factor,
        "backlash_factor": gearing.backlash_factor,
        **{key: value for key, value in numbers.items() if value is not None},
        **{key: value for key, value in words.items() if value},
    }


def _error_table(error: LinkError | None) -> dict[str, Any] | str:
    if error is None:
        return "none"
    return {"low": error.low, "high": error.high, "cost": curve_table(error.curve)}


def _frame(stem: str, axes: tuple[str, ...], parameters: Mapping[str, Value]) -> dict[str, Any]:
    units = {axis: "deg" if axis[0] == "r" else "mm" for axis in axes}
    return {f"{axis}_{unit}": parameters[f"nominal_{stem}_{axis}_{unit}"] for axis, unit in units.items()}


def _cell_table(cell: Cell) -> dict[str, Any]:
    table: dict[str, Any] = {
        "at": "tool" if cell.of_tool else "flange",
        "turn_deg": _scale_for_table(cell.turn, arm.DEG),
    }
    if cell.near:
        table["near_deg"] = _scale_for_table(cell.near, arm.DEG)
    if not cell.listed:
        return table | {
            "centre_mm": _scale_for_table(cell.centre, MM),
            "side_mm": cell.side / MM,
            "poses": cell.kind,
            "per_edge": cell.per_edge,
        }
    key = "joints_deg" if cell.in_joints else "poses"
    return table | {key: [_pose_row(row, cell.in_joints) for row in cell.listed]}


def _pose_row(row: tuple[float, ...], in_joints: bool) -> list[float]:
    if in_joints:
        return _scale_for_table(row, arm.DEG)
    return [*_scale_for_table(row[:3], MM), *_scale_for_table(row[3:], arm.DEG)]


def _scale_for_table(values: tuple[float, ...], unit: float) -> list[float]:
    """Numbers in a unit, without the last digits of the division, so that they read back alike."""
    return [float(f"{value:.15g}") for value in (np.array(values) / unit).tolist()]
