"""Generic forms: smooth functions of each input, orders, direction, products, levels.

They show where a residual has structure and in which form, whatever its cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.effects.effect import kind_of
from ...models.effects.measurements import SESSION, labels_of, unit_numbers
from ...models.effects.memory import FORCES
from ...models.effects.unresolved import RADII, cubic_splines, plays, wave
from ...models.gear import SUN
from ...models.measurable import Column, Role
from ...section import Array
from ...units import converted
from .data import GapData
from .linear import Groups, join_groups

HIGHEST = 130.0
"""Highest order of the periodogram, unless the gear has higher ones; its grid is of quarters."""
ORDERS_BEYOND_GEAR = 10.0
"""Orders above the highest of the gear that are searched."""
MAX_ORDER = 600.0
OVER_A_WORKSPACE = 12.0
"""The same where the angle is that of a pose: no teeth pass by."""
LEVELS, STEP, SWING = "levels", "step", "swing"
"""Shapes of a form over labels, an order and the time: a separate level for each label, a step, a
slow wave."""
ODD, EVEN, FROM_ZERO, FROM_LEAST = "odd", "even", "from zero", "from least"
"""Shapes of a power: of a signed input odd or even, of another one from zero or its least."""
MEAN = "mean of the units"
PREDICTED = "predicted "
"""Prefix of the name of an output: its prediction as a variable."""
USUAL = (1.0, 2.0, 4.0)
"""Orders also tried with an amplitude that depends on another input, in addition to the gear's."""
CYCLES = tuple(np.arange(0.75, 8.1, 0.25).tolist())
"""Cycles over the record that are tried."""
POWERS = (0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0)
SMOOTH = (Role.TORQUE, Role.FORCE, Role.SPEED, Role.TEMPERATURE, Role.TIME, Role.PAYLOAD, Role.POSITION, Role.INPUT)


@dataclass(frozen=True, slots=True)
class Form:
    """Meaning of a group of generic columns: `kind` as in a `Region`, over `variable` and
    `further_variables`.

    `shape` is one of those above; a step comes `after` so many `of` all. `powers` are those of the
    two inputs of a single product. A wave may grow `by` a column or role to the power `by_power`.
    """

    kind: str
    variable: str
    order: float = np.nan
    direction: str = ""
    further_variables: tuple[str, ...] = ()
    shape: str = ""
    after: int = 0
    of: str = ""
    powers: tuple[int, int] | None = None
    by: str = ""
    by_power: int = 1

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of all variables."""
        return (self.variable, *self.further_variables)

    @property
    def detail(self) -> str:
        """Further details of the form in words, empty where there are none."""
        if self.shape == STEP:
            return f"step after {self.after} of {self.of}"
        if self.shape == SWING:
            return f"a swing of {self.order:g} cycles"
        if self.powers is not None:
            return f"powers {self.powers[0]} and {self.powers[1]}"
        if self.by:
            return f"times {self.by}" + (" squared" if self.by_power == 2 else "")
        return self.shape


def generic(data: GapData, predicted: Mapping[str, Array] | None = None) -> tuple[list[Form], list[Array]]:
    """Forms and their columns (n, m), of one output; `predicted` replaces a missing load."""
    forms: list[tuple[Form, Array]] = []
    linear = data.target.units.get(Role.ANGLE) == "m"  # a position along an axis turns no gear
    inputs = [c for c in data.inputs if c.role in SMOOTH or (c.role is Role.ANGLE and linear)]
    values = {c.name: data.values(c.name) for c in inputs}
    sign = _direction(data)
    for column in inputs:
        forms += _smooth(column, values[column.name], sign)
    if sign is not None:
        forms.append((Form("direction", "direction", direction="odd"), sign[:, None]))
    forms += _products(inputs, values, sign)
    forms += _raw_products(inputs, values, sign)
    if predicted is not None and not {Role.TORQUE, Role.FORCE} & set(data.measurements.by_role):
        forms += [
            (Form("interval", f"{PREDICTED}{o.name}"), spline(predicted[o.name], 6))
            for o in data.outputs
            if np.ptp(predicted[o.name]) > 0.0 and not data.target.population
        ]
    if data.target.population:  # its mean is not free
        forms.append((Form("distribution", MEAN), np.ones((len(data), 1))))
    forms += _along_units(data)
    forms += _steps(data)
    forms += _swings(inputs, values)
    forms += _levels(data)
    forms += _memories(data)
    if Role.ANGLE in data.measurements:
        forms += _orders(data)
    return [form for form, _ in forms], [columns for _, columns in forms]


def _direction(data: GapData) -> Array | None:
    sign = data.measurements[Role.DIRECTION] if Role.DIRECTION in data.measurements else np.zeros(1)
    return np.asarray(sign, dtype=float) if np.ptp(sign) else None


def stretches(column: Column, rows: int) -> int:
    """The number of stretches of a spline over an input, for so many rows."""
    fine = 6 if column.role in (Role.TORQUE, Role.FORCE) else 4
    return min(fine, max(2, rows // 25))


def knots(values: Array, count: int) -> Array:
    """The ends of `count` stretches of values (n,) with equally many rows."""
    return np.asarray(np.unique(np.quantile(values, np.linspace(0, 1, count + 1))))


def spline(values: Array, count: int) -> Array:
    """Cubic B-splines (n, count + 3) of values (n,), their knots at quantiles."""
    inner = knots(values, count)
    if len(inner) < 3:
        return values[:, None].astype(float)
    return cubic_splines(values, inner)


def _smooth(column: Column, x: Array, sign: Array | None) -> list[tuple[Form, Array]]:
    """Smooth functions of one input, equal in both directions and opposite in them."""
    kind = "trend" if column.role is Role.TIME else "interval"
    curve = spline(x, stretches(column, len(x)))
    forms = [(Form(kind, column.name), curve)]
    forms += [(form, values[:, None]) for form, values in _powers(column, x)]
    return forms + _directional_forms(forms, sign)


def _directional_forms(forms: list[tuple[Form, Array]], sign: Array | None) -> list[tuple[Form, Array]]:
    """The same forms, opposite in the two directions (n,); none without directions."""
    if sign is None:
        return []
    return [(replace(form, direction="odd"), columns * sign[:, None]) for form, columns in forms]


def _powers(column: Column, x: Array) -> list[tuple[Form, Array]]:
    """Powers of a signed input, odd and even; of any other, from zero and from its minimum."""
    size, ones = np.abs(x) / np.abs(x).max(), np.ones_like(x)
    if (x < 0).any() and (x > 0).any():
        bases = {ODD: (size, np.sign(x)), EVEN: (size, ones)}
    else:
        bases = {FROM_ZERO: (size, ones), FROM_LEAST: ((x - x.min()) / np.ptp(x), ones)}
    return [
        (Form("power", column.name, order=power, shape=which), sign * magnitude**power)
        for which, (magnitude, sign) in bases.items()
        for power in POWERS
    ]


def _scaled(x: Array) -> Array:
    return np.asarray((x - x.mean()) / x.std())


def _products(inputs: list[Column], values: dict[str, Array], sign: Array | None) -> list[tuple[Form, Array]]:
    """Products of two inputs, each to the first and second power."""
    forms = []
    for first, second in combinations(inputs, 2):
        a, b = _scaled(values[first.name]), _scaled(values[second.name])
        columns = np.column_stack([a * b, a * a * b, a * b * b, a * a * b * b])
        both = [(Form("product", first.name, further_variables=(second.name,)), columns)]
        forms += both + _directional_forms(both, sign)
    return forms


def _raw_products(inputs: list[Column], values: dict[str, Array], sign: Array | None) -> list[tuple[Form, Array]]:
    """Products of two unscaled inputs, one column each: a usual form of laws of two variables."""
    forms = []
    for first, second in combinations(inputs, 2):
        a, b = (from_origin(c, values[c.name]) for c in (first, second))
        for p, q in ((1, 1), (2, 1), (1, 2)):
            form = Form("product", first.name, further_variables=(second.name,), powers=(p, q))
            both = [(form, (a**p * b**q)[:, None])]
            forms += both + _directional_forms(both, sign)
    return forms


def origin(column: Column) -> float:
    """Where a law of an input begins, in its unit: 20 degC of a temperature, else 0."""
    return float(converted(20.0, "C", column.unit)) if column.role is Role.TEMPERATURE else 0.0


def from_origin(column: Column, x: Array) -> Array:
    """An input (n,) relative to its origin, scaled to magnitude 1 at most."""
    away = x - origin(column)
    return np.asarray(away / max(float(np.abs(away).max()), 1e-300))


def _swings(inputs: list[Column], values: dict[str, Array]) -> list[tuple[Form, Array]]:
    """Slow waves of the time, each a separate form: a hall that warms by day, a pump."""
    forms = []
    for column in inputs:
        if column.role is Role.TIME:
            fraction = (values[column.name] - values[column.name].min()) / np.ptp(values[column.name])
            for cycles in CYCLES:
                form = Form("trend", column.name, order=cycles, shape=SWING)
                forms.append((form, wave(2.0 * np.pi * cycles * fraction)))
    return forms


def _steps(data: GapData) -> list[tuple[Form, Array]]:
    """Steps in the order of measuring, each a separate form."""
    name = next((c.name for c in data.inputs if c.role is Role.TIME), "")
    return _steps_in(np.arange(len(data)), name, "measurements") if name else []


def _steps_in(at: NDArray[Any], name: str, what: str) -> list[tuple[Form, Array]]:
    """Steps at places of an order `at` (n,)."""
    n = len(at)
    return [
        (Form("trend", name, shape=STEP, after=k, of=f"{n} {what}"), (at >= k)[:, None] * 1.0)
        for k in np.unique(np.linspace(n * 0.08, n * 0.92, 22).astype(int)).tolist()
    ]


def _along_units(data: GapData) -> list[tuple[Form, Array]]:
    """Smooth functions of the order in which the units of a population were made, and steps."""
    name = order_of_units(data)
    if not name:
        return []
    at = np.argsort(np.argsort(unit_numbers(data.measurements), kind="stable"))
    curve = spline(at.astype(float), min(6, max(2, len(at) // 25)))
    return [(Form("trend", name), curve), *_steps_in(at, name, "units")]


def order_of_units(data: GapData) -> str:
    """The column that numbers the units of a population, empty where there is none."""
    if not data.target.population or Role.UNIT not in data.measurements:
        return ""
    return next(c.name for c in data.target.columns if c.role is Role.UNIT)


def _levels(data: GapData) -> list[tuple[Form, Array]]:
    """A separate level for each unit, lot or session."""
    names = [c.name for c in data.target.columns if c.role in (Role.UNIT, Role.LOT)]
    names += [SESSION] if SESSION in data.measurements.table else []
    forms = []
    for name in names:
        labels, number = labels_of(data.measurements.table[name])
        if 2 <= len(labels) <= max(2, len(data) // 8):
            columns = (number[:, None] == np.arange(1, len(labels))).astype(float)
            forms.append((Form("interval", name, shape=LEVELS), columns))
    return forms


def _memories(data: GapData) -> list[tuple[Form, Array]]:
    """Plays of each input that drives a path which turns back, of forces the travel: hysteresis of any shape."""
    of_forces = all(kind_of(output.unit) in FORCES for output in data.outputs)
    roles = data.target.reversing & ({Role.ANGLE} if of_forces else data.target.reversing)
    driving = {c.role: c.name for c in reversed(data.inputs) if c.role in roles}
    values = {name: data.values(name) for name in driving.values()}
    return [(Form("memory", n), plays(data.measurements, x / float(np.ptp(x)), RADII[::2])) for n, x in values.items()]


def order_grid(data: GapData) -> Array:
    """The orders of the periodogram, in steps of a quarter."""
    angle = data.measurements[Role.ANGLE]
    least = 0.25 * np.ceil(4.0 * np.pi / max(float(np.ptp(angle)), 1e-9))  # less than half a wave is a slope
    highest = OVER_A_WORKSPACE if Role.POSITION in data.measurements else HIGHEST
    if data.target.gear is not None:
        highest = min(max(highest, data.target.gear.waves[-1] + ORDERS_BEYOND_GEAR), MAX_ORDER)
    return np.arange(max(0.25, least), highest + 0.1, 0.25)


def _orders(data: GapData) -> list[tuple[Form, Array]]:
    """Waves of each order, alone and growing with the load."""
    angle = np.asarray(data.measurements[Role.ANGLE], dtype=float)
    load = next((r for r in (Role.TORQUE, Role.FORCE) if r in data.measurements), None)
    if np.ptp(angle) < 0.1:
        return []
    column = next(c for c in data.inputs if c.role is Role.ANGLE)
    forms = []
    for order in order_grid(data):
        columns, form = wave(order * angle), Form("order", column.name, order=float(order))
        forms.append((form, columns))
        if load is not None and order == np.floor(order):
            size = data.measurements[load] / max(float(np.abs(data.measurements[load]).max()), 1e-300)
            forms.append((replace(form, by=str(load)), columns * size[:, None]))
    return forms + _modulated_waves(data, column, angle)


def usual_orders(data: GapData) -> tuple[float, ...]:
    """Orders of encoder and gear, without the sun's in the housing, 1 above the one before."""
    gear = data.target.gear
    if gear is None:
        return USUAL
    sun = gear.orders.get(SUN, 0.0)
    return (*USUAL, *(order for order in gear.waves if order != sun))


def _modulated_waves(data: GapData, column: Column, angle: Array) -> list[tuple[Form, Array]]:
    """Waves of the usual orders that grow with another input, or with its square."""
    forms = []
    for order in (order for order in usual_orders(data) if order * np.ptp(angle) >= np.pi):
        columns = wave(order * angle)
        for second in (c for c in data.inputs if c.role in (*SMOOTH, Role.DIRECTION)):
            x = data.values(second.name)
            form = Form("order", column.name, order=order, further_variables=(second.name,), by=second.name)
            for power in (1,) if second.role is Role.DIRECTION else (1, 2):
                size = (x / np.abs(x).max()) ** power
                forms.append((replace(form, by_power=power), columns * size[:, None]))
    return forms


def stack_columns(groups: Groups, outputs: int) -> tuple[Groups, NDArray[np.int64]]:
    """The columns separately for each output, over the rows of all; the output of each group."""
    which = np.repeat(np.arange(outputs), len(groups.starts))
    if outputs == 1:
        return groups, which
    whole = scipy.linalg.block_diag(*[groups.columns] * outputs)
    starts = np.concatenate([groups.starts + at * groups.columns.shape[1] for at in range(outputs)])
    return Groups(whole, starts, np.tile(groups.one_sided, outputs)), which


def groups_of(columns: list[Array]) -> Groups:
    """Generic columns as groups of either sign."""
    return join_groups(columns, [False] * len(columns))
