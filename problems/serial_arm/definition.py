"""What a configuration of `serial_arm` declares: joints, their reducers, and the cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...declarations import Kind, Parameter, Value, Variable, completed, number
from ...models.costs import CostCurve, Reciprocal
from ...models.serial_arm import declared
from ...models.serial_arm.cell import Cell
from ..pose_accuracy.grouping import RANGE
from ..reducers.nested import Nested
from ..robot import definition
from ..robot.definition import Drive
from ..robot.outputs import PARAMETERS as OF_ROBOTS

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
        reference = REFERENCE[declared.ERRORS[kind][0]]
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
        every = {kind: given.get(kind, LinkError.usual(kind)) for kind in declared.ERRORS}
        return {kind: error for kind, error in every.items() if error is not None}


@dataclass(frozen=True)
class Definition(definition.Definition):
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
            declared.error(kind, at): error
            for at, joint in enumerate(self.joints, 1)
            for kind, error in joint.links.items()
        }

    @property
    def link_variables(self) -> tuple[Variable, ...]:
        kinds = {
            declared.error(kind, at): (at, *row)
            for at in range(1, len(self.joints) + 1)
            for kind, row in declared.ERRORS.items()
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
        chain_parameters = [p for p in declared.PARAMETERS if declared.joint_of(p.name) <= count]
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
