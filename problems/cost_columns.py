"""Further costs of a problem, such as CO2 or machine hours: columns that are sums of curves, as the cost is.

A column is the sum of curves of its own over the variables, or a weighted sum of other columns. Where
the form of a problem has the very curves of its cost, any weighted sum of columns has a form as well:
that of the cost with other curves, so that everything that is proven of the cost is proven of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..errors import Fault, nearest
from ..models.cost_reading import curve_table, read_curve, weighted_sum
from ..models.costs import CostCurve, Reciprocal
from ..models.machine_offers import Offer, ways_of
from ..models.machine_offers import Way as MadeWay
from ..models.machines import ConvexHull, GoodPartsByLimit, GoodPartsBySpread, at_prices
from ..section import POSITIVE, Array, Output, Range, Section, shown
from ..units import family
from .declaration import Declaration, Interval
from .forms import Feature, Form, Way

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem

COST = "cost"
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_UNIT = re.compile(r"[^\s,;]{1,16}( [^\s,;]{1,16})?")
NOT_NEGATIVE = Range(low=0.0)
NO_CURVE = "whose scatter does not depend on t: state price"
T = TypeVar("T")
Curves = tuple[CostCurve, ...]
"""The curve of each way of making a variable, in the order of its choice; a single one is for all ways. That of a
way by machine is `GoodPartsByLimit` of the machine with the column in the place of its prices, which falls as well."""


@dataclass(frozen=True, slots=True)
class CostColumn:
    """A further cost in a `unit`: the sum of `curves` by variable, or of columns by `weights`."""

    name: str
    unit: str = ""
    curves: Mapping[str, Curves] = field(default_factory=dict)
    weights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Robust:
    """How well the cost curves are known: the true one is the stated one times 1/f to f.

    `factors` by variable, one for each way of making it or one for all; `factor` is that of the others.
    """

    factor: float | None = None
    factors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def of(self, variable: str, way: int) -> float | None:
        """The factor of a curve, None where none is stated."""
        factors = self.factors.get(variable)
        return self.factor if factors is None else factors[way if len(factors) > 1 else 0]


# How a configuration states them: `[[cost]]`, `[robust]`.


def read_cost_columns(top: Section, declared: Declaration) -> tuple[CostColumn, ...]:
    """The columns of `[[cost]]`: name, unit, and curves by part or variable, or weights by column."""
    taken = {COST, *(o.name for o in declared.outputs), *(v.name for v in declared.variables)}
    sections = top.items(COST)
    named = [section.take("name") for section in sections]
    summed = [name for name, section in zip(named, sections, strict=True) if "weights" not in section]
    columns = []
    for at, section in enumerate(sections):
        name, unit = section.text("name"), section.text("unit") or ""
        if "name" not in section:
            section.fault("name", 'is missing: the column of results, such as "co2_kg"')
        elif name is not None and not _NAME.fullmatch(name):
            section.fault("name", f'must be letters, digits and _, and begin with a letter, got "{name}"')
        elif name is not None and (name in taken or name in named[:at]):
            section.fault("name", f'"{name}" is the name of another output or variable')
        if unit and not _UNIT.fullmatch(unit):
            section.fault("unit", f'must be a unit, such as "kg", got "{unit}"')
        if ("weights" in section) == ("curves" in section):
            section.fault("curves", "give either curves by part or variable, or weights of other columns")
        read, made = partial(_read_curve, unit=_known_unit(unit)), partial(_read_machines, unit=_known_unit(unit))
        curves = by_variable(section.section("curves"), declared, read, made)
        weights = _read_weights(section.section("weights"), [COST, *(str(n) for n in summed)])
        section.finish()
        if name is not None:
            columns.append(CostColumn(name, unit, curves, weights))
    return tuple(columns)


def _read_weights(section: Section, columns: Sequence[str]) -> dict[str, float]:
    numbers = {name: section.number(name, within=NOT_NEGATIVE) for name in columns}
    for name in section.all_keys():
        if name not in numbers:
            section.take(name)
            known = f"is no column that curves sum up{nearest(name, columns)}; one of {', '.join(columns)}"
            section.fault(name, known)
    section.finish()
    weights = {name: value for name, value in numbers.items() if value is not None}
    if weights and not sum(weights.values()) > 0.0:
        section.fault("", "must not all be zero")
    return weights


def priceable(declared: Declaration) -> dict[str, str]:
    """The variables that may have a further cost, by the names that a configuration knows them by."""
    if declared.costs:
        return {name: name for name in declared.costs}
    names = [v.name for v in declared.variables if v.tolerance]
    return {name.removesuffix("_t"): name for name in names}


def labels_of(declared: Declaration, variable: str) -> tuple[str, ...]:
    """The ways of making what a variable tolerates, empty where there is one."""
    return next((v.labels for v in declared.variables if v.name == choice_of(variable)), ())


def choice_of(variable: str) -> str:
    """The variable that would choose the process or machine of a tolerance."""
    return re.sub("_(t|um|mrad)$", "", variable) + "_process"


def by_variable(
    section: Section,
    declared: Declaration,
    read: Callable[[Section, str], T | None],
    by_machine: Callable[[Section, Sequence[Offer]], list[T | None]] | None = None,
) -> dict[str, tuple[T, ...]]:
    """What a table says of each variable, or of each process of it in a table of its own.

    `by_machine` reads from such a table what it says of each way of using machines.
    """
    known, found = priceable(declared), {}
    for key in section.all_keys():
        variable = known.get(key) or (key if key in known.values() else None)
        if variable is None:
            section.take(key)
            section.fault(key, f"is no part or variable with a cost{nearest(key, known)}; one of {', '.join(known)}")
            continue
        labels, table = labels_of(declared, variable), section.take(key)
        offers = declared.machines.get(variable, ()) if by_machine else ()
        labels = labels[: len(labels) - len(ways_of(offers))]
        names = [*labels, *(offer.machine.name for offer in offers)]
        if not _are_names(names) or (variable in declared.machines and by_machine and not offers):
            continue  # whose processes or machines have faults of their own
        if offers and (fault := _is_no_table_of(table, names[len(labels) :], labels)):
            section.fault(key, fault)
            continue
        if not (offers or (labels and isinstance(table, dict) and set(table) & set(labels))):
            values = [read(section, key)]
        else:
            inner = section.section(key)
            values = [read(inner, label) for label in labels]
            for label in labels:
                if label not in inner:
                    inner.fault(label, f"is missing: state it for each process of {key}")
            values += by_machine(inner, offers) if by_machine else []
            inner.finish()
        if all(value is not None for value in values):
            found[variable] = tuple(value for value in values if value is not None)
    section.finish()
    return found


def _are_names(names: Sequence[str]) -> bool:
    """Whether each of them is stated, and once."""
    return "" not in names and len(set(names)) == len(names)


def _is_no_table_of(table: object, machines: Sequence[str], processes: Sequence[str]) -> str:
    """What is wrong where a single number or curve is stated for several ways; empty for a table by machine."""
    if not isinstance(table, dict):
        return f"must be a table with a value for each of {', '.join([*processes, *machines])}, got {shown(table)}"
    if "model" not in table or "model" in machines or "model" in processes:
        return ""
    curves = f", and a curve of each of {', '.join(processes)}" if processes else ""
    return f"has machines, {NO_CURVE} of each of {', '.join(machines)}{curves}"


def _known_unit(unit: str) -> str:
    """The unit of a column as far as values can be converted to it: empty for that of a currency."""
    try:
        family(unit)
    except ValueError:
        return ""
    return unit


def _read_curve(section: Section, key: str, unit: str) -> CostCurve | None:
    """A curve, or a number: the same at every tolerance."""
    if isinstance(section.take(key), dict):
        return read_curve(section.section(key))
    constant = section.number(key, unit, NOT_NEGATIVE)
    return None if constant is None else Reciprocal(constant, 0.0)


def _read_machines(section: Section, offers: Sequence[Offer], unit: str) -> list[CostCurve | None]:
    """The curve of each way of using machines: `lathe = 0.4` of a piece, or a table as `_read_prices` takes it."""
    curves: list[CostCurve | None] = []
    for offer in offers:
        name, prices = offer.machine.name, None
        stated = section.take(name)
        if isinstance(stated, dict) and "model" in stated:
            section.fault(name, f"is a machine, {NO_CURVE}")
        elif isinstance(stated, dict):
            prices = _read_prices(section.section(name), offer, unit)
        elif name in section:
            price = section.number(name, unit, NOT_NEGATIVE)
            prices = None if price is None else (price, 0.0, 0.0)
        else:
            section.fault(name, "is missing: state it for each machine, or 0")
        made = [way.machine for way in offer.ways()]
        curves += [None if prices is None else GoodPartsByLimit(one.with_prices(*prices)) for one in made]
    return curves


def _read_prices(table: Section, offer: Offer, unit: str) -> tuple[float, float, float] | None:
    """Of a piece (`price`, or `per_hour` and `time`, with its share of `setup`), its inspection and a rework."""
    inspection = offer.machine.inspection
    known = {"setup": offer.setup, "inspection": inspection, "rework": inspection and inspection.rework}
    value = {key: table.number(key, unit, NOT_NEGATIVE) for key in ("price", *known)}
    per_hour, time = table.number("per_hour", unit and f"{unit}/h", NOT_NEGATIVE), table.number("time", "h", POSITIVE)
    if ("price" in table) == ("per_hour" in table):
        table.fault("price", "give either price, that of a piece, or per_hour and the time of a piece")
    elif ("per_hour" in table) != ("time" in table):
        table.fault("time", 'is the time of a piece at a price per_hour: state both, such as time = "5 min"')
    for key, stated in known.items():
        if key in table and stated is None:
            table.fault(key, f"is what the machine does not have: leave it out, or state {key} with the machine")
    table.finish()
    if any(key in table and number is None for key, number in value.items()):
        return None
    price = per_hour * time if per_hour is not None and time is not None else value["price"]
    share = (value["setup"] or 0.0) / offer.setup.lot if offer.setup else 0.0
    return None if price is None else (price + share, value["inspection"] or 0.0, value["rework"] or 0.0)


def column_tables(problem: ToleranceProblem) -> dict[str, Any]:
    """The tables `[[cost]]` that state the columns of a problem."""
    tables = []
    for column in problem.settings.cost_columns:
        table: dict[str, Any] = {"name": column.name} | ({"unit": column.unit} if column.unit else {})
        curves = {name: _curve_tables(problem, name, ways) for name, ways in column.curves.items()}
        stated = {"weights": dict(column.weights)} if column.weights else {"curves": curves}
        tables.append(table | stated)
    return {COST: tables} if tables else {}


def _curve_tables(problem: ToleranceProblem, name: str, curves: Curves) -> dict[str, Any]:
    """The curve of a variable, or the table of what is stated of each process and machine of it."""
    machines = [curve.machine for curve in curves if isinstance(curve, GoodPartsByLimit)]
    tables = [curve_table(curve) for curve in curves[: len(curves) - len(machines)]]
    if not machines:
        return dict(_by_process(problem, {name: tables})[name])
    stated = dict(zip(labels_of(problem.declaration, name), tables, strict=False))
    for machine in machines:
        prices = zip(("price", "inspection", "rework"), machine.prices, strict=True)
        stated[machine.name] = {key: value for key, value in prices if value or key == "price"}
    return stated


def _by_process(problem: ToleranceProblem, values: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """What is stated of each variable, in a table by process where it has several values."""
    labels = {name: labels_of(problem.declaration, name) for name in values}
    return {
        name: ways[0] if len(ways) == 1 else dict(zip(labels[name], ways, strict=True)) for name, ways in values.items()
    }


def with_columns(declaration: Declaration, columns: Sequence[CostColumn]) -> Declaration:
    """The declaration with the columns among its outputs; no condition changes them."""
    known = {output.name for output in declaration.outputs}
    more = tuple(
        Output(column.name, column.unit, _meaning(column), low=0.0) for column in columns if column.name not in known
    )
    names = frozenset(column.name for column in columns)
    return replace(declaration, outputs=(*declaration.outputs, *more), unconditional=declaration.unconditional | names)


def _meaning(column: CostColumn) -> str:
    if column.weights:
        return "weighted sum: " + " + ".join(f"{weight:g} {name}" for name, weight in column.weights.items())
    return "further cost, sum of the curves of its own"


FACTOR = Range(low=1.0, high=1000.0)
"""Of an uncertain curve: 1 is known exactly."""


def read_robust(top: Section, declared: Declaration) -> Robust | None:
    """`[robust] factor = 1.5, [robust.factors]`: within which factor each cost curve is known."""
    if "robust" not in top:
        top.accept(("robust",))
        return None
    section = top.section("robust")
    factor = section.number("factor", within=FACTOR)
    factors = by_variable(section.section("factors"), declared, lambda table, key: table.number(key, within=FACTOR))
    section.finish()
    return Robust(factor, factors)


def robust_table(problem: ToleranceProblem) -> dict[str, Any]:
    """The table `[robust]` of a problem."""
    robust = problem.settings.robust
    if robust is None:
        return {}
    factor = {} if robust.factor is None else {"factor": robust.factor}
    return {"robust": factor | {"factors": _by_process(problem, robust.factors)}}


def factor_faults(problem: ToleranceProblem) -> list[Fault]:
    """Cost curves without a factor, where factors are stated, and what no allocation can be robust of."""
    robust = problem.settings.robust
    if robust is None:
        return []
    faults = []
    if problem.objectives != (COST,) or problem.held_costs:
        text = "needs the cost as the only objective, and no limit on a further cost"
        faults.append(Fault("robust", f'{text}: set objectives.minimise = ["cost"] and limit other outputs'))
    for variable in problem.variables:
        if problem.curves_of(variable.name) and robust.of(variable.name, 0) is None:
            place = f"robust.factors.{variable.name.removesuffix('_t')}"
            text = "is missing: state the factor within which this cost curve is known"
            faults.append(Fault(place, f"{text}, or one for all, robust.factor"))
    return faults


# What they are at designs.


def _ways_of(problem: ToleranceProblem, designs: Array, variable: str, ways: int) -> Array:
    """Number of the way (n,) by which the variable is made."""
    choice = choice_of(variable)
    if ways == 1 or choice not in problem.names:
        return np.zeros(len(designs), dtype=np.int64)
    return np.rint(problem.column(designs, choice)).astype(np.int64)


def _by_variable(
    problem: ToleranceProblem, column: CostColumn, designs: Array, slope: bool = False
) -> dict[str, Array]:
    """What each variable adds to a column of curves (n,), or the derivative by it."""
    values = {}
    for name, curves in column.curves.items():
        t, ways = problem.column(designs, name), _ways_of(problem, designs, name, len(curves))
        values[name] = np.zeros(len(designs))
        for at, curve in enumerate(curves):
            rows = ways == at
            with np.errstate(divide="ignore"):
                each = curve.slope(t[rows]) if slope else curve.cost(t[rows])
            values[name][rows] = problem.pieces_of(name) * each
    return values


def costs_by_variable(problem: ToleranceProblem, designs: Array) -> dict[str, dict[str, Array]]:
    """By column, what each variable adds to it (n,)."""
    return {c.name: _by_variable(problem, c, designs) for c in problem.settings.cost_columns if c.curves}


def column_values(problem: ToleranceProblem, designs: Array, cost: Array) -> dict[str, Array]:
    """The columns (n,) at full designs whose first cost is `cost` (n,)."""
    parts, nothing = costs_by_variable(problem, designs), np.zeros(len(designs))
    values = {name: np.asarray(sum(each.values(), nothing)) for name, each in parts.items()}
    return _with_sums(problem.settings.cost_columns, {COST: cost} | values)


def column_slopes(problem: ToleranceProblem, designs: Array, cost: Array) -> dict[str, Array]:
    """Derivatives (n, all variables) of the columns, from those of the first cost."""
    slopes = {COST: cost}
    for column in problem.settings.cost_columns:
        if column.curves:
            slopes[column.name] = np.zeros_like(designs)
            for name, slope in _by_variable(problem, column, designs, slope=True).items():
                slopes[column.name][:, problem.names.index(name)] = slope
    return _with_sums(problem.settings.cost_columns, slopes)


def _with_sums(columns: Sequence[CostColumn], values: dict[str, Array]) -> dict[str, Array]:
    sums = {c.name: sum(w * values[name] for name, w in c.weights.items()) for c in columns if c.weights}
    return {name: value for name, value in values.items() if name != COST} | {n: np.asarray(v) for n, v in sums.items()}


def _ends(problem: ToleranceProblem, variable: str, curves: Curves) -> Iterator[tuple[int, float, float, CostCurve]]:
    """Number, tightest and loosest tolerance and curve of each way of making a variable."""
    for at, (low, high) in enumerate(problem.ranges_of(variable)):
        yield at, low, high, curves[at if len(curves) > 1 else 0]


def column_interval(problem: ToleranceProblem, name: str, cost: Interval) -> Interval:
    """Least and largest value of a column over the search space, from those of the first cost."""
    ends = {COST: np.array(cost)}
    for column in problem.settings.cost_columns:
        ends[column.name] = np.zeros(2)
        for variable, curves in column.curves.items():
            ways = _ends(problem, variable, curves)
            whole = [curve.cost(np.array([high, low])) for _, low, high, curve in ways]
            ends[column.name] += problem.pieces_of(variable) * np.array([np.min(whole), np.max(whole)])
    low, high = (ends | _with_sums(problem.settings.cost_columns, ends))[name].tolist()
    return low, high


def column_faults(problem: ToleranceProblem) -> list[Fault]:
    """Curves that are not finite in the range of their variable."""
    faults = []
    for at, column in enumerate(problem.settings.cost_columns):
        for name, curves in column.curves.items():
            place = f"cost[{at}].curves.{name.removesuffix('_t')}"
            for _, low, high, curve in _ends(problem, name, curves):
                with np.errstate(all="ignore"):
                    finite = np.isfinite(curve.cost(np.array([low, high])))
                if not np.all(finite):
                    end = (low, high)[int(np.argmin(finite))]
                    faults.append(Fault(place, f"must be finite in the whole range, but is not at {end:g}"))
    return faults


def column_notes(problem: ToleranceProblem) -> tuple[str, ...]:
    """Which variables have a cost but no curve of a column."""
    notes = []
    for column in problem.settings.cost_columns:
        made, names = problem.declaration.machines, [v.name for v in problem.variables]
        missing = [n for n in names if (n in made or problem.curves_of(n)) and n not in column.curves]
        if column.curves and missing:
            notes.append(f"{column.name} counts nothing for {', '.join(missing)}: no curve of it is stated")
    return tuple(notes)


# Forms of weighted sums of columns.


def weighted_form(problem: ToleranceProblem, form: Form, weights: Mapping[str, float]) -> Form | None:
    """The form of a weighted sum of columns, from that of the first cost; None where its curves are others."""
    plain: dict[str, float] = {}
    columns = {column.name: column for column in problem.settings.cost_columns}
    for name, weight in weights.items():
        for of, inner in (columns[name].weights if name in columns and columns[name].weights else {name: 1.0}).items():
            plain[of] = plain.get(of, 0.0) + weight * inner
    of_cost = plain.pop(COST, 0.0)
    terms = [(weight, columns[name].curves) for name, weight in plain.items() if weight > 0.0]

    def curve_of(feature: Feature, way: Way) -> CostCurve | None:
        name, at = feature.variable or feature.choice, int(way.choice) if feature.variable and feature.choice else 0
        more = [
            (weight, curves[name][at if len(curves[name]) > 1 else 0]) for weight, curves in terms if name in curves
        ]
        if more and not feature.variable:
            value = np.array([way.choice])
            more = [(weight, Reciprocal(float(curve.cost(value)[0]), 0.0)) for weight, curve in more]
        elif more and feature.count != problem.pieces_of(name):
            return None
        elif more and (made := _made_by(problem, name, at)) is not None:
            return _curve_by_machine(made, way, of_cost, more)
        elif more and name not in problem.declaration.machines:  # whose processes a form has as they are stated
            known = problem.curves_of(name)
            same = known[at][0] == way.curve if len(known) > at else way.curve == Reciprocal(0.0, 0.0)
            if not same or way.curve.priced:
                return None
        return weighted_sum([(of_cost, way.curve), *more])

    return _with_curves(problem, form, curve_of, of_cost, terms)


def _made_by(problem: ToleranceProblem, variable: str, at: int) -> MadeWay | None:
    """The way of using a machine that a value of the choice stands for, None where it is no machine."""
    ways = ways_of(problem.declaration.machines.get(variable, ()))
    number = at + len(ways) - len(labels_of(problem.declaration, variable))
    return ways[number] if ways and number >= 0 else None


def _curve_by_machine(
    made: MadeWay, way: Way, of_cost: float, more: Sequence[tuple[float, CostCurve]]
) -> CostCurve | None:
    """That of the machine with its weighted prices, of which the cost of a good part is a linear function."""
    curve = way.curve.of if isinstance(way.curve, ConvexHull) else way.curve
    known = curve.machine if isinstance(curve, GoodPartsBySpread | GoodPartsByLimit) else None
    if known != made.machine and curve != made.curve:
        return None
    others = [weight * np.array(other.machine.prices) for weight, other in more if isinstance(other, GoodPartsByLimit)]
    prices = np.sum([of_cost * np.array(made.machine.prices), *others], axis=0)
    return at_prices(curve, made.machine.with_prices(*prices.tolist()), way.low, way.high)


def _with_curves(
    problem: ToleranceProblem,
    form: Form,
    curve_of: Callable[[Feature, Way], CostCurve | None],
    of_cost: float,
    terms: Sequence[tuple[float, Mapping[str, Curves]]],
) -> Form | None:
    features = []
    for feature in form.features:
        curves = [curve_of(feature, way) for way in feature.ways]
        ways = tuple(replace(way, curve=c) for way, c in zip(feature.ways, curves, strict=True) if c is not None)
        if len(ways) < len(curves):
            return None
        features.append(replace(feature, ways=ways))
    base, searched = of_cost * form.base, {feature.variable or feature.choice for feature in form.features}
    design = np.array([[problem.fixed.get(name, np.nan) for name in problem.names]])
    for weight, by_name in terms:
        rest = {name: curves for name, curves in by_name.items() if name not in searched}
        if not all(name in problem.fixed for name in rest):
            return None
        values = _by_variable(problem, CostColumn("", curves=rest), design)
        base += weight * float(sum(value[0] for value in values.values()))
    also = [_with_curves(problem, other, curve_of, of_cost, terms) for other in form.also]
    whole = tuple(other for other in also if other is not None)
    if len(whole) < len(also):
        return None
    exact = form.exact and not any(isinstance(way.curve, ConvexHull) for feature in features for way in feature.ways)
    return replace(form, features=tuple(features), base=base, also=whole, exact=exact)
