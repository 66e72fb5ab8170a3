"""Generic forms: smooth functions of each input, orders, direction, products, levels.

They show where a residual has structure and in which form, whatever its cause; as terms of the corrected
model they stand for it where no effect does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from operator import itemgetter
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.effects.angle import highest_order
from ...models.effects.effect import kind_of
from ...models.effects.measurements import SESSION, labels_of, unit_numbers
from ...models.effects.memory import FORCES
from ...models.effects.unresolved import (
    EVEN,
    FROM_LEAST,
    FROM_ZERO,
    LEVELS,
    ODD,
    RADII,
    STEP,
    SWING,
    Form,
    Term,
    Unresolved,
    fewest_plays,
    knots,
    plays,
    spline,
    wave,
)
from ...models.gear import SUN
from ...models.measurable import Column, Role
from ...section import Array
from .data import GapData
from .fit import Fitter, Member, is_term
from .library import Candidate
from .linear import Groups, basis, project_out

HIGHEST = 130.0
"""Highest order of the periodogram, unless the gear has higher ones; its grid is of quarters."""
ORDERS_BEYOND_GEAR = 10.0
"""Orders above the highest of the gear that are searched."""
MAX_ORDER = 600.0
OVER_A_WORKSPACE = 12.0
"""The same where the angle is that of a pose: no teeth pass by."""
MEAN = "mean of the units"
PREDICTED = "predicted "
"""Prefix of the name of an output: its prediction as a variable."""
USUAL = (1.0, 2.0, 4.0)
"""Orders also tried with an amplitude that depends on another input, in addition to the gear's."""
CYCLES = tuple(np.arange(0.75, 8.1, 0.25).tolist())
"""Cycles over the record that are tried."""
POWERS = (0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0)
SMOOTH = (Role.TORQUE, Role.FORCE, Role.SPEED, Role.TEMPERATURE, Role.TIME, Role.PAYLOAD, Role.POSITION, Role.INPUT)


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
    return min(6 if column.role in (Role.TORQUE, Role.FORCE) else 4, max(2, rows // 25))


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


def _products(inputs: list[Column], values: dict[str, Array], sign: Array | None) -> list[tuple[Form, Array]]:
    """Products of two inputs, each to the first and second power."""
    forms = []
    for first, second in combinations(inputs, 2):
        a, b = ((x - x.mean()) / x.std() for x in (values[first.name], values[second.name]))
        columns = np.column_stack([a * b, a * a * b, a * b * b, a * a * b * b])
        both = [(Form("product", first.name, further_variables=(second.name,)), columns)]
        forms += both + _directional_forms(both, sign)
    return forms


def _raw_products(inputs: list[Column], values: dict[str, Array], sign: Array | None) -> list[tuple[Form, Array]]:
    """Products of two unscaled inputs, one column each: a usual form of laws of two variables."""
    forms = []
    for first, second in combinations(inputs, 2):
        a, b = (c.from_origin(values[c.name]) for c in (first, second))
        for p, q in ((1, 1), (2, 1), (1, 2)):
            form = Form("product", first.name, further_variables=(second.name,), powers=(p, q))
            both = [(form, (a**p * b**q)[:, None])]
            forms += both + _directional_forms(both, sign)
    return forms


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
    return np.arange(max(0.25, least), min(highest, highest_order(angle)) + 0.1, 0.25)


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


# Generic forms as terms of the corrected model.


WITHIN = 0.9
"""Fraction of an effect's column in the span of a form from which the form is taken without it; a
form of one column is then the effect itself.
"""


def effect_of(member: Member) -> Unresolved:
    """The effect of a generic term."""
    effect = member.candidate.effect
    assert isinstance(effect, Unresolved)
    return effect


def is_plays(member: Member) -> bool:
    """Whether a member of a fit is a memory without a name."""
    return is_term(member) and effect_of(member).term.shape == "plays"


def label(member: Member) -> str:
    """The label of a term on the path of a selection."""
    return f"unresolved term of {' x '.join(effect_of(member).term.variables)}"


def table_of(member: Member, values: Mapping[str, float]) -> dict[str, Any]:
    """The `[[unresolved]]` table of a term with these values of its parameters."""
    return effect_of(member).term.table(effect_of(member).coefficients(values))


def term_of(form: Form, data: GapData, output: str) -> Term | None:
    """The term of a form for these data; None where the form is no function of their inputs."""
    columns = {c.name: c for c in data.inputs}
    turns = form.direction == "odd"
    if form.kind == "direction":
        name = next(c.name for role in (Role.DIRECTION, Role.SPEED) for c in data.inputs if c.role is role)
        return Term(output, name, "constant", turns=True)
    if form.shape == LEVELS and not data.target.population:
        labels, _ = labels_of(data.measurements.table[form.variable])
        return Term(output, form.variable, "levels", labels=tuple(labels.tolist()))
    if form.variable not in columns or data.target.population:
        return None
    base = Term(output, form.variable, "constant", turns=turns)
    x = data.values(form.variable)
    if form.kind == "order":
        return _wave(base, form, data)
    if form.kind == "product":
        return _product(base, form, data, columns)
    if form.kind == "power":
        return _power(base, form, x)
    if form.kind == "memory":
        return replace(base, shape="plays", scale=float(np.ptp(x)), radii=RADII)
    if form.shape == STEP:
        at = form.after
        later = bool((x[at:] > x[at - 1]).all() and (x[:at] < x[at]).all())  # not with own clocks
        return replace(base, shape="step", zero=float(x[at])) if later else None
    if form.shape == SWING:
        size = float(np.ptp(x)) / (2.0 * np.pi)
        return replace(base, shape="swing", order=form.order, zero=float(x.min()), scale=size)
    return _spline(base, columns[form.variable], x) if not form.shape else None


def _spline(base: Term, column: Column, x: Array) -> Term:
    inner = knots(x, stretches(column, len(x)))
    if len(inner) < 3:
        return replace(base, shape="power", signed=True)
    return replace(base, shape="spline", knots=tuple(inner.tolist()))


def _power(base: Term, form: Form, x: Array) -> Term:
    term = replace(base, shape="power", exponent=float(form.order), scale=float(np.abs(x).max()))
    if form.shape == FROM_LEAST:
        return replace(term, zero=float(x.min()), scale=float(np.ptp(x)))
    return replace(term, signed=form.shape == ODD)


def _product(base: Term, form: Form, data: GapData, columns: dict[str, Column]) -> Term:
    second = form.further_variables[0]
    x, y = data.values(form.variable), data.values(second)
    if form.powers is None:
        term = replace(base, shape="product", zero=float(x.mean()), scale=float(x.std()))
        return replace(term, times=second, times_zero=float(y.mean()), times_scale=float(y.std()))
    p, q = form.powers
    ends = [columns[n].origin for n in (form.variable, second)]
    sizes = [float(np.abs(v - z).max()) for v, z in zip((x, y), ends, strict=True)]
    return replace(
        base,
        shape="power",
        exponent=float(p),
        signed=p == 1,
        zero=ends[0],
        scale=sizes[0],
        times=second,
        times_exponent=float(q),
        times_zero=ends[1],
        times_scale=sizes[1],
    )


def _wave(base: Term, form: Form, data: GapData) -> Term:
    term = replace(base, shape="wave", order=float(form.order))
    if not form.by:
        return term
    by = (*form.further_variables, *(c.name for c in data.inputs if str(c.role) == form.by))[0]
    size = float(np.abs(data.values(by)).max())
    return replace(term, times=by, times_exponent=float(form.by_power), times_scale=size)


def member_of(term: Term, data: GapData, fitter: Fitter, members: Sequence[Member]) -> Member | None:
    """A term as a member of a fit of `members`, orthogonal to the named effects in its span, or None."""
    if term.shape == "plays":
        known = [effect_of(member).term for member in members if is_plays(member)]
        again = (term.variable, term.output) in [(other.variable, other.output) for other in known]
        term = replace(term, radii=()) if again else _choose_plays(term, data, fitter, members)
        if not term.radii:
            return None
    form = project_out(fitter.white(member_with(Unresolved(term), data)), fitter.q)
    q, r, order = scipy.linalg.qr(form, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(r)) > 1e-5 * max(float(np.abs(r[0, 0])), 1e-300)))
    q, r, kept = q[:, :rank], r[:rank, :rank], order[:rank]
    named = (member for member in members if not is_term(member))
    columns = (column for member in named for column in project_out(fitter.white(member), fitter.q).T)
    inside = [q.T @ c for c in columns if float(np.sum((q.T @ c) ** 2)) > WITHIN * float(c @ c) > 0.0]
    if term.shape == "plays" and not inside:
        return member_with(Unresolved(term), data)
    if len(kept) == 1:
        return None if inside else _mix_term(term, data, np.eye(term.count)[:, kept])
    spanned = basis(np.column_stack(inside)) if inside else np.zeros((rank, 0))
    rest = scipy.linalg.null_space(spanned.T) if spanned.shape[1] else np.eye(rank)
    if rest.shape[1] == 0:
        return None
    mix = np.zeros((term.count, rest.shape[1]))
    mix[kept] = np.linalg.solve(r, rest)
    return _mix_term(term, data, mix / np.abs(mix).max(axis=0))


def _choose_plays(term: Term, data: GapData, fitter: Fitter, members: Sequence[Member]) -> Term:
    """The term with the fewest plays, of either sense, that are each worth their price by non-negative least
    squares given the members of a fit; at most MOST_PLAYS, perhaps none.
    """
    q = fitter.spanned(members)
    rotation, columns = np.linalg.qr(project_out(fitter.white(member_with(Unresolved(term), data)), q))
    y = rotation.T @ fitter.y
    fits = [(*fewest_plays(sense * columns, y, fitter.penalty), sense) for sense in (1.0, -1.0)]
    _, kept, sense = min(fits, key=itemgetter(0))
    return replace(term, scale=sense * term.scale, radii=tuple(term.radii[k] for k in kept))


def without_idle_plays(member: Member, coefficients: Array, data: GapData) -> Member:
    """A term of plays without those that have no weight; any other member as it is."""
    if not is_plays(member) or not (0.0 < np.mean(coefficients == 0.0) < 1.0):
        return member
    term = effect_of(member).term
    radii = tuple(radius for radius, weight in zip(term.radii, coefficients, strict=True) if weight)
    return member_with(Unresolved(replace(term, radii=radii)), data)


def whole_term(member: Member, data: GapData) -> Member:
    """A term with all columns of its form."""
    return member_with(Unresolved(effect_of(member).term), data)


def _mix_term(term: Term, data: GapData, mix: Array) -> Member:
    return member_with(Unresolved(term, mix if mix.shape[1] < term.count or term.count > 1 else None), data)


def member_with(effect: Unresolved, data: GapData) -> Member:
    """A term as a member of a fit."""
    return Member(Candidate(effect, effect.own_parameters(data.target), ()))
