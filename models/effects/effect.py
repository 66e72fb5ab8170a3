"""The interface of a physical effect that a model may miss."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import inf, isfinite
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...section import Array, Output
from ...units import dimension, unit_key
from ..gear import Gear
from ..measurable import Changeable, Column, Role

Values = Mapping[str, float]
"""Parameters of an effect by name."""
FAMILIES = (
    "load",
    "geometry by angle",
    "speed",
    "temperature, time",
    "memory",
    "population",
    "manipulator",
    "assembly",
    "instrument",
)


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A number of an effect; physics bounds it, sign included.

    The name carries the unit (`rate_arcsec_per_K`). The effect is a sum of its `linear`
    parameters, each times a function of the nonlinear ones; at 0 (their default) it does nothing. A
    nonlinear parameter has no default: it must be given. It may be one of `choices` only.
    """

    name: str
    unit: str
    meaning: str
    low: float = 0.0
    high: float = inf
    linear: bool = True
    choices: tuple[float, ...] = ()

    @property
    def phase(self) -> bool:
        """Whether it is an angle over a full circle; a resolution in degrees is not."""
        return self.unit == "deg" and self.high - self.low == 360.0

    @property
    def stem(self) -> str:
        """The name without its unit."""
        return self.name.removesuffix(f"_{unit_key(self.unit)}") if self.unit else self.name

    @property
    def words(self) -> str:
        """Its meaning, with its choices where it is chosen instead of fitted."""
        choices = ", ".join(f"{choice:g}" for choice in self.choices)
        return f"{self.meaning} (chosen out of {choices}, not fitted)" if choices else self.meaning

    @property
    def small(self) -> float:
        """A small value of a linear parameter, at which a model is still linear in it."""
        end = self.high if self.high > 0 else self.low
        return 0.01 * end if isfinite(end) else 1.0

    @property
    def inner(self) -> float:
        """A value within its bounds."""
        if isfinite(self.low) and isfinite(self.high):
            return 0.5 * (self.low + self.high)
        return self.low + 1.0 if isfinite(self.low) else 0.5 * min(self.high, 2.0)

    def scale(self, value: float) -> float:
        """The scale of a nonlinear parameter there: about one cell of the grid."""
        if self.phase:
            return 15.0
        return 0.3 * abs(value) if value else 1.0

    def grid(self, spread: float, free: int, coarse: int) -> list[float]:
        """Values of one of `free` nonlinear parameters, `coarse` ones where there are several; `spread` is the scale
        of one without a bound.
        """
        if self.choices:
            return list(self.choices)
        low, high = self.low, self.high
        count = 15 if free == 1 else 24 if self.phase or self.unit == "Hz" else coarse
        if self.phase:
            return [float(x) for x in np.linspace(low, high, count, endpoint=False)]
        if isfinite(high) and low == -high and self.unit == "s":  # a delay of either sign
            half = np.geomspace(high * SHORTEST_DELAY, high, count // 2)
            return [float(x) for x in (*-half[::-1], *half)]
        if not isfinite(high):
            high = max(low, 0.0) + 10.0 * spread
        if not isfinite(low):
            low = -high
        if low >= 0.0:
            return [float(x) for x in np.geomspace(max(low, high * 1e-3), high, count)]
        return [float(x) for x in np.linspace(low, high, count)]

    def stops(self, value: float, factor: float, several: bool) -> bool:
        """Whether a value is at a physical bound, or under the lower one times a factor; 0 is a bound below if the
        effect has `several` sizes.
        """
        width, low = abs(value) * 1e-6, factor * self.low
        stops_below = isfinite(low) and (low != 0.0 or several)
        at_end = (isfinite(self.high) and value >= self.high - width) or (stops_below and value <= low + width)
        return at_end and not self.choices


COARSE, MAX_GRID_POINTS = 4, 400
"""Values of each of three or more nonlinear parameters on their grid, and its points, at most."""


def grid(numbers: Sequence[EffectParameter], spread: float) -> list[dict[str, float]]:
    """Grid of nonlinear parameters; a single empty set without any. `spread` is the scale of unbounded ones."""
    free = sum(not number.choices for number in numbers)
    axes = [number.grid(spread, free, COARSE if free > 2 else 6) for number in numbers]
    while np.prod([len(axis) for axis in axes]) > MAX_GRID_POINTS:
        longest = max(range(len(axes)), key=lambda k: len(axes[k]))
        axes[longest] = axes[longest][::2]
    names = [number.name for number in numbers]
    return [dict(zip(names, point, strict=True)) for point in product(*axes)]


FEW = "fewer than half a wave over the angle"
STILL = 1e-6
"""[rad] Range of an angle that did not change."""
SHORTEST_DELAY = 0.01
"""Smallest delay that is tried, as a fraction of the longest."""
MOTION = frozenset({Role.SPEED, Role.DIRECTION, Role.TIME})
"""Roles of columns that give the travel together."""
KINDS = {
    "angle": "an angle",
    "length": "a length",
    "speed": "a speed",
    "torque": "a torque",
    "force": "a force",
    "current": "a current",
}
"""Kinds of outputs that an effect may name, in words."""
_UNITS = {"angle": "rad", "length": "m", "speed": "rad/s", "torque": "Nm", "force": "N", "current": "A"}


def kind_of(unit: str) -> str:
    """The kind of a quantity of that unit; empty for a plain number or an unknown unit."""
    try:
        quantity_dimension = dimension(unit) if unit else ""
    except ValueError:
        return ""
    if not quantity_dimension:
        return ""
    return next((kind for kind, base_unit in _UNITS.items() if dimension(base_unit) == quantity_dimension), "other")


def quantity(
    stem: str,
    unit: str,
    meaning: str,
    low: float = 0.0,
    high: float = inf,
    linear: bool = True,
    choices: tuple[float, ...] = (),
) -> EffectParameter:
    """The parameter `stem`, with its unit put into its name."""
    name = f"{stem}_{unit_key(unit)}" if unit else stem
    return EffectParameter(name, unit, meaning, low, high, linear, choices)


def _empty_mapping() -> Mapping[Any, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Target:
    """The model that an effect is added to: its name and outputs, the columns of the table, the
    quantities that may be changed inside, and whether each row is a unit of a population.

    Where the table is known, `largest` holds the largest magnitude of a column by role (in the
    units of `Measurements`), `labels` the labels of unit and lot, and `locked` whether the rows follow
    the load of a unit with a locked input (None where no table is known); `pace` is the usual
    step of the clock [s], `derived` are roles that follow from another column, `paths` the ranges of
    columns that change in small steps from row to row, in the order of measuring, `reversing` those
    of them that turn back at least twice. With `several`
    outputs the names of an effect's parameters begin with that of their output. `gear` has the
    orders of its errors, None where it is not known.
    """

    model: str
    outputs: tuple[Output, ...]
    columns: tuple[Column, ...]
    changeable: tuple[Changeable, ...] = ()
    population: bool = False
    several: bool = False
    largest: Mapping[Role, float] = field(default_factory=_empty_mapping)
    labels: Mapping[Role, tuple[str, ...]] = field(default_factory=_empty_mapping)
    units: Mapping[Role, str] = field(default_factory=_empty_mapping)
    locked: bool | None = None
    gear: Gear | None = None
    pace: float = 0.0
    derived: frozenset[Role] = frozenset()
    paths: Mapping[Role, float] = field(default_factory=_empty_mapping)
    reversing: frozenset[Role] = frozenset()

    def travelled(self) -> frozenset[Role]:
        """The roles of the columns, and the angle where speed and time give the travel."""
        travel = {Role.ANGLE} if self.roles() >= MOTION else frozenset()
        return self.roles() | travel

    def roles(self) -> frozenset[Role]:
        """The roles of the columns of the table."""
        return frozenset(column.role for column in self.columns) | self.derived

    def changes(self, *names: str) -> bool:
        """Whether all these quantities may be changed inside the model."""
        return set(names) <= {changeable.name for changeable in self.changeable}

    def prefix(self, output: Output) -> str:
        """The prefix of the names of parameters of one output."""
        stem = output.name.removesuffix(f"_{unit_key(output.unit)}")
        return f"{stem}_" if self.several else ""


@dataclass(frozen=True, slots=True)
class Measurements:
    """The rows of a table as effects receive them: by column name, and by role in fixed units.

    By role: angle [rad], torque [N m], force [N], direction [+1, -1], speed [rpm], temperature
    [degC], time [s], payload [kg], position [m] (a column that moves along a line instead of
    turning: angle [m], speed [m/s]); unit and lot are labels. Rows are those of the table; `order`
    (n,) lists them in the order of measurement (by `time` where there is one).
    """

    table: Mapping[str, NDArray[Any]]
    by_role: Mapping[Role, NDArray[Any]]
    order: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(next(iter(self.table.values()))) if self.table else 0

    def __getitem__(self, role: Role) -> NDArray[Any]:
        """The first column (n,) of that role. Raises KeyError where there is none."""
        return self.by_role[role]

    def __contains__(self, role: Role) -> bool:
        return role in self.by_role

    @property
    def in_order(self) -> NDArray[np.int64]:
        """The rows (n,) in the order of measurement, that of the table where there is no time."""
        return np.arange(len(self)) if self.order is None else self.order


@dataclass(frozen=True, slots=True)
class Action:
    """The action of an effect on n rows; exactly one of the fields is used.

    - `changes`: added to changeable quantities inside the model, by name, (n,);
    - `output`: added to outputs, by name, (n,), in their units;
    - `reading`: the measurement of an output, by name: a function of the output (n,);
    - `population`: the changed units of a batch: a function of the drawn values (n,), the model's
      mean and a generator.
    """

    changes: Mapping[str, Array] = field(default_factory=_empty_mapping)
    output: Mapping[str, Array] = field(default_factory=_empty_mapping)
    reading: Mapping[str, Callable[[Array], Array]] = field(default_factory=_empty_mapping)
    population: Callable[[Array, float, np.random.Generator], Array] | None = None


class Effect(ABC):
    """A named physical effect: its cause, the columns that it needs, and its action.

    Effects compose in a fixed order: changes inside the model, then the population, then the
    outputs, then the instrument. Where a model has a changeable quantity of the effect's
    name (`bearing_clearance_mm`), the effect acts there, with that quantity as its only parameter,
    in `inside_bounds`; elsewhere it does its `own_action`.
    """

    name: ClassVar[str]
    family: ClassVar[str]
    cause: ClassVar[str]
    """One sentence."""
    formula: ClassVar[str] = ""
    """The term that is added, in the symbols of docs/effects.md."""
    needs: ClassVar[tuple[Role, ...]] = ()
    holds_at_ends: ClassVar[bool] = False
    """Whether a simulation keeps it, outside of the record it was found in, at its value at the end of that."""
    yields_to: ClassVar[str] = ""
    """The family whose effects are named instead of it where they fit as well."""
    mistaken_for: ClassVar[tuple[str, ...]] = ()
    """Names of the effects that it is easily confused with."""
    separated_by: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """What to record or measure instead, by the name of an effect that no operating point separates from it."""
    reference: ClassVar[str] = ""
    along_units: ClassVar[bool] = False
    """Whether it grows from unit to unit, as tool wear does."""
    together: ClassVar[int] = 1
    """How many of its linear parameters of an output, one after the other, have one sign, whichever it is."""
    of_rows: ClassVar[bool] = False
    """Whether it acts on single measurements only, not on the units of a population."""
    of_stiffness: ClassVar[bool] = False
    """Whether the reciprocal of its parameter is a stiffness, which no drive has of any size."""
    dimensions: ClassVar[tuple[str, ...]] = ()
    """The kinds of outputs that it can act on, of `KINDS`; empty for any."""
    inside_bounds: ClassVar[tuple[float, float]] = (0.0, inf)
    inside_name: ClassVar[str] = ""
    """The quantity inside a model that represents the effect, where it has another name."""

    reach: ClassVar[str] = ""
    """Stem of the number at whose least value nothing of the rows before is left: rows show no shorter memory."""

    def place(self, target: Target) -> Changeable | None:
        """The changeable quantity with the effect's name, without its unit."""
        name = self.inside_name or self.name
        matches = (c for c in target.changeable if c.name in (name, f"{name}_{unit_key(c.unit)}"))
        return next(matches, None)

    def applies(self, target: Target) -> bool:
        """Whether the effect has a place in this model, with the columns of this table."""
        return self.place(target) is not None or (bool(self.reached(target)) and self.own_applies(target))

    def lacks(self, measurements: Measurements, target: Target) -> str:
        """Why the rows do not show it, where it applies: of a single angle, or of less than half a wave, waves fit any
        offset or slope. Else empty.
        """
        still = Role.ANGLE in {*self.needs} & {*measurements.by_role} and np.ptp(measurements[Role.ANGLE]) < STILL
        return FEW if still else ""

    def lacks_path(self, target: Target) -> str:
        """Why the rows of a table are not the path that it needs; empty where they are, or where it needs none."""
        return ""

    def reached(self, target: Target) -> tuple[Output, ...]:
        """The outputs that it can act on: of its `dimensions`, or of an unknown unit."""
        kinds = (*self.dimensions, "")
        return tuple(o for o in target.outputs if not self.dimensions or kind_of(o.unit) in kinds)

    def acts_in(self, target: Target | None = None) -> set[Role]:
        """The roles of the variables that it follows, with those along whose path it has a memory in a target; a
        force stands for a torque.
        """
        return {*self.needs, Role.FORCE} if Role.TORQUE in self.needs else {*self.needs}

    def left_out(self, target: Target) -> str:
        """Why it does not apply to this model with these columns; empty where it does."""
        if self.applies(target):
            return ""
        if missing := [str(role) for role in self.needs if role not in target.roles()]:
            return f"no column of the role {' or '.join(missing)}"
        if not self.reached(target):
            kinds = " or ".join(KINDS[dimension] for dimension in self.dimensions)
            return f"acts on an output that is {kinds}"
        return self.own_reason(target)

    def own_reason(self, target: Target) -> str:
        """Why `own_applies` does not hold, where no column is missing."""
        return "no place in this model"

    def parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        """Its parameters for this target."""
        place = self.place(target)
        if place is None:
            return self.own_parameters(target)
        low, high = self.inside_bounds
        return (EffectParameter(place.name, place.unit, place.meaning, low, high, linear=False),)

    def parameter(self, name: str, target: Target) -> EffectParameter | None:
        """The parameter that a configuration names, by its name or by its stem."""
        matches = (number for number in self.parameters(target) if name in (number.name, number.stem))
        return next(matches, None)

    def missing(self, values: Values, target: Target) -> tuple[str, ...]:
        """Names of the parameters that must be given in addition to `values`: nonlinear ones."""
        return tuple(n.name for n in self.parameters(target) if not n.linear and n.name not in values)

    def shown(self, measured: Mapping[str, Array], target: Target) -> Mapping[str, float] | None:
        """Nonlinear parameters that follow from the measured outputs (n,), by name; None where
        these show that the effect is absent.
        """
        return {}

    def read_from(self, gap: Array, measurements: Measurements, target: Target) -> dict[str, float]:
        """Nonlinear parameters at which it explains most of a gap (n,), where no grid meets them; else empty."""
        return {}

    def act(self, measurements: Measurements, values: Values, target: Target) -> Action:
        """Its action on the rows, with `values` of its parameters by name."""
        place = self.place(target)
        if place is None:
            return self.own_action(measurements, values, target)
        return Action(changes={place.name: np.full(len(measurements), values[place.name])})

    def kinds_of_rows(self, measurements: Measurements, whole: Array) -> NDArray[np.int64] | None:
        """The kinds (n,) of rows in which its nonlinear parameters have to agree, given an output `whole`
        (n,); None where there are none.
        """
        return None

    def described(self, values: Values, target: Target) -> dict[str, tuple[float, str]]:
        """Quantities reported in addition to the parameters (amplitude, phase): value and unit."""
        return {}

    def stated(self) -> dict[str, Any]:
        """Further keys of the `[[effect]]` table that states it."""
        return {}

    def own_applies(self, target: Target) -> bool:
        """Whether it can act where no quantity inside has its name."""
        return set(self.needs) <= target.roles() and not (self.of_rows and target.population)

    @abstractmethod
    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        """Its parameters where no quantity inside has its name."""

    @abstractmethod
    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        """Its action on the rows where no quantity inside has its name."""


def value_or_zero(values: Values, name: str) -> float:
    """A linear parameter, 0 where it is not given."""
    return float(values.get(name, 0.0))


# Effects that act inside a model only.


CHAINS = (1, 2, 3)
"""Numbers of the chains of a manipulator, each with an arm and its drive."""


class Inside(Effect):
    """Acts where a model has a quantity of its name, and nowhere else."""

    def own_applies(self, target: Target) -> bool:
        return False

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return ()

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        return Action()


class InsideSeveral(Inside):
    """Adds linear parameters to quantities of a model, each times a factor per row.

    Those quantities act on their own row of a table alone.
    """

    def own_applies(self, target: Target) -> bool:
        return target.changes(*(name for _, name in self.numbers(target))) and set(self.needs) <= target.roles()

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return tuple(number for number, _ in self.numbers(target))

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        factor = self.factor(measurements, values)
        numbers = self.numbers(target)
        return Action(changes={name: value_or_zero(values, number.name) * factor for number, name in numbers})

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        """The linear parameters, each with the quantity that it changes."""
        return ()

    def factor(self, measurements: Measurements, values: Values) -> np.ndarray:
        """The factor (n,) of the parameters."""
        return np.ones(len(measurements))
